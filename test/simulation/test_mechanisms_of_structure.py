"""Attachments and alterations, each against the solution of its equation."""

import numpy as np
import pytest
from scipy import linalg

from afm_scan_ros.simulation.axis import Dynamics, first_resonance, series
from afm_scan_ros.simulation.mechanisms.attachment import AttachedStage, SprungBody
from afm_scan_ros.simulation.mechanisms.material import AgedCreep, LostPoling
from afm_scan_ros.simulation.mechanisms.structure import (
    CoupledStage,
    HeavierLoad,
    RidingMass,
    YieldingTube,
)
from afm_scan_ros.simulation.scanner import PlantSpec

STEP = 5e-6
STAGE = AttachedStage(2.0 * np.pi * 454.0, 0.012)
RNG = np.random.default_rng(0)


@pytest.mark.parametrize(
    ("attachment", "carried"),
    [
        (RidingMass(axis="x", mass_ratio=0.2, frequency=800.0, damping=0.01), (1.0, 0.0)),
        (CoupledStage(axis="x", share=0.05, frequency=330.0, damping=0.02), (0.5, 0.5)),
    ],
)
def test_a_body_moves_by_its_matrix(
    attachment: RidingMass | CoupledStage, carried: tuple[float, float]
) -> None:
    """Under a step of both axes: the exponential of mass, spring and dashpot, by scipy."""
    body = attachment.attached(STAGE)
    assert isinstance(body, SprungBody)
    (a, b), k = carried, body.stiffness
    w, d, own, loss = STAGE.natural, STAGE.damping, body.natural, body.damping
    c, ka = 2 * loss / own, k * a
    matrix = np.array(
        [
            [0, 1, 0, 0, 0],
            [-(w**2) * (1 + ka), -2 * d * w - w**2 * ka * c, w**2 * k, w**2 * k * c, -(w**2) * ka],
            [0, 0, 0, 1, 0],
            [own**2 * a, own**2 * c * a, -(own**2), -(own**2) * c, own**2 * (a + b)],
            [0, 0, 0, 0, 0],
        ]
    )
    step, state, expected = linalg.expm(matrix * STEP), np.array([0, 0, 0, 0, 1e-6]), []
    for _ in range(3000):
        state = step @ state
        expected.append(state[0])
    path = np.full((2, 3001), 1e-6)
    moving = np.concatenate((np.zeros(2), body.own_at_rest()))
    np.testing.assert_allclose(body.integrate(moving, path, STEP), expected, atol=1e-12)


def test_a_coupled_axis_moves_by_its_share_at_last() -> None:
    body = CoupledStage(axis="x", share=0.03, frequency=330.0, damping=0.3).attached(STAGE)
    state = body.at_rest(STEP, RNG)
    _, moved = body.apply(state, np.vstack((np.zeros(200_000), np.full(200_000, 1e-6))), STEP)
    assert moved[0, -1] == pytest.approx(0.03e-6, rel=1e-3)
    np.testing.assert_array_equal(moved[1], 1e-6)


def test_a_tube_that_never_yields_is_a_stiffer_one() -> None:
    springs = YieldingTube(axis="x", share=0.1, reaches=(1.0,)).attached(STAGE)
    pushed = np.vstack((np.full(400_000, 1e-6), np.zeros(400_000)))
    _, moved = springs.apply(springs.at_rest(STEP, RNG), pushed, STEP)
    assert moved[0, -1] == pytest.approx(1e-6 / 1.1, rel=1e-6)
    spectrum = np.abs(np.fft.rfft(moved[0, 1:200_001] - moved[0, -1]))
    assert spectrum.argmax() == pytest.approx(454.0 * np.sqrt(1.1), abs=1.0)


def test_a_tube_that_yields_gains_and_loses_the_more_it_bends() -> None:
    springs = YieldingTube(axis="x", share=0.1, reaches=(1e-6, 4e-6)).attached(STAGE)
    turn = 2.0 * np.pi * np.arange(80_000) / 40_000
    gains, losses = [], []
    for amplitude in (1e-8, 1e-6, 1e-5):
        push = np.vstack((amplitude * np.sin(turn), np.zeros(turn.size)))
        _, moved = springs.apply(springs.at_rest(STEP, RNG), push, STEP)
        phasor = np.mean(moved[0, 40_000:] * np.exp(-1j * turn[40_000:])) * 2j / amplitude
        gains.append(abs(phasor))
        losses.append(-np.angle(phasor))
    assert gains[0] == pytest.approx(1.0 / 1.1, rel=1e-3)
    assert gains[0] < gains[1] < gains[2]
    assert losses[1] > 0.005 > abs(losses[0])


def test_alterations_change_what_they_name(plant: PlantSpec) -> None:
    axis = plant.x
    heavier = HeavierLoad(axis="x", mass_ratio=0.21).altered(axis)
    was, now = (first_resonance(each.vibration) for each in (axis, heavier))
    assert abs(now) == pytest.approx(abs(was) / 1.1)
    assert now.real == pytest.approx(was.real / 1.21)  # half of dashpot over mass
    aged = AgedCreep(axis="x", factor=1.5).altered(axis)
    (gains, taus), (old_gains, old_taus) = series(aged.creep), series(axis.creep)
    np.testing.assert_allclose(gains, 1.5 * old_gains, rtol=1e-9)
    np.testing.assert_allclose(taus, old_taus, rtol=1e-9)
    omega = np.array([0.0, 1.0, 2800.0, 8700.0])
    poled = LostPoling(axis="x", loss=0.1).altered(axis)
    whole, left = (Dynamics.from_spec(each, 1.0).response(omega) for each in (axis, poled))
    np.testing.assert_allclose(left, 0.9 * whole, rtol=1e-9)
