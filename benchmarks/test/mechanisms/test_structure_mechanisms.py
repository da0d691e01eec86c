"""Mechanisms of structure.py, each against the solution of its equation."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import integrate, signal

from afm_scan_bench.mechanisms import structure
from afm_scan_bench.mechanisms.structure import (
    CABLE_ORDERS,
    CABLE_TERMS,
    STOP_REACH,
    Cable,
    CrackedLeaf,
    GluedMirror,
    SprungHolder,
    TautCable,
    TouchedStop,
)
from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.axis import Dynamics, first_resonance
from afm_scan_ros.simulation.mechanisms.attachment import AttachedStage
from afm_scan_ros.simulation.scanner import PlantSpec
from helpers.acting import STAGE, STEP, TIME, WAVE, S, act, answer, held


def test_a_holder_swings_by_its_transfer_function() -> None:
    natural, holder = 2.0 * np.pi * 900.0, SprungHolder(axis="x", frequency=900.0, damping=0.02)
    loss = 2.0 * 0.02 * natural
    system = signal.lti([loss, natural**2], [1.0, loss, natural**2])
    _, expected, _ = signal.lsim(system, WAVE, STEP * np.arange(WAVE.size))
    np.testing.assert_allclose(act(holder, WAVE), expected, atol=2e-12)


def mirrored(mirror: GluedMirror) -> Array:
    attached = mirror.attached(STAGE)
    both = np.vstack((WAVE, np.zeros(WAVE.size)))
    return attached.apply(attached.at_rest(STEP, np.random.default_rng(0)), both, STEP)[1][0]


def test_a_mirror_pulls_by_zeners_solid() -> None:
    """As a complex stiffness: the glue's spring beside a spring and a dashpot in series."""
    mirror = GluedMirror(axis="x", mass_ratio=0.2, frequency=600.0, relaxing=0.4, settling=1e-3)
    natural = 2.0 * np.pi * 600.0
    stiff, slow = natural**2 * (1.0 + 1.4e-3 * S), 1.0 + 1e-3 * S
    stage = S**2 + 2.0 * STAGE.damping * STAGE.natural * S + STAGE.natural**2
    free = stage * (stiff + slow * S**2)
    expected = answer(free, free + 0.2 * stiff * S**2)
    np.testing.assert_allclose(mirrored(mirror), expected, atol=1e-10 * 1e-6)


def stopped(stop: TouchedStop, path: Array, stage: AttachedStage = STAGE) -> Array:
    attached, both = stop.attached(stage), np.vstack((path, np.zeros(path.size)))
    return attached.apply(attached.at_rest(STEP, np.random.default_rng(0)), both, STEP)[1][0]


def test_a_stage_comes_to_its_stop_and_goes_by_hertz() -> None:
    push, place, natural = 5e-6, 4e-6, STAGE.natural

    def swing(t: float, s: Array) -> list[float]:
        beyond = max(float(np.interp(t, TIME, WAVE)) + s[0] - place, 0.0)
        held = -push * (beyond / STOP_REACH) ** 1.5 - s[0]
        return [s[1], natural**2 * held - 2.0 * STAGE.damping * natural * s[1]]

    found = integrate.solve_ivp(
        swing, (0.0, TIME[-1]), [0.0, 0.0], "DOP853", TIME, max_step=20 * STEP, rtol=1e-8
    )
    moved = stopped(TouchedStop(axis="x", place=place, push=push), WAVE)
    np.testing.assert_allclose(moved, WAVE + found.y[0], atol=2e-3 * np.abs(found.y[0]).max())
    np.testing.assert_array_equal(moved[:50], WAVE[:50])


@settings(deadline=None, max_examples=20)
@given(free=st.floats(5e-6, 40e-6), push=st.floats(1e-9, 1e-5))
def test_a_stop_holds_by_the_power_of_three_halves(free: float, push: float) -> None:
    path = free * np.minimum(np.arange(2000) / 1000.0, 1.0)
    held = stopped(TouchedStop(axis="x", place=5e-6, push=push), path, AttachedStage(1e5, 0.7))[-1]
    pressed = max(held - 5e-6, 0.0)
    assert free - held == pytest.approx(push * (pressed / STOP_REACH) ** 1.5, abs=1e-12)


@settings(deadline=None, max_examples=20)
@given(loss=st.floats(0.0, 0.5))
def test_a_cracked_leaf_leaves_mass_dashpot_and_force(plant: PlantSpec, loss: float) -> None:
    cracked = CrackedLeaf(axis="x", loss=loss).altered(plant.x)
    before, after = (first_resonance(axis.vibration) for axis in (plant.x, cracked))
    assert after.real == pytest.approx(before.real, rel=1e-9)  # c / 2 m
    assert abs(after) ** 2 == pytest.approx((1.0 - loss) * abs(before) ** 2, rel=1e-9)  # k / m
    gain, softer = (
        axis.vibration.numerator[-1] / axis.vibration.denominator[-1] for axis in (plant.x, cracked)
    )
    assert softer * (1.0 - loss) == pytest.approx(gain, rel=1e-9)
    modes = [Dynamics.from_spec(axis, 1e-6) for axis in (plant.x, cracked)]
    assert cracked.creep == plant.x.creep
    further = [np.abs(each.gains[np.argmax(each.poles.imag)]) for each in modes]
    assert further[1] == pytest.approx(further[0], rel=1e-3)  # but for where creep is read


def test_a_cable_swings_as_a_string_does(monkeypatch: pytest.MonkeyPatch) -> None:
    """Against the wave equation's own solution, 1 - k cot k, once it has come to swing."""
    monkeypatch.setattr(structure, "CABLE_TERMS", 40)
    monkeypatch.setattr(structure, "CABLE_ORDERS", np.arange(1.0, 41.0))
    cable = TautCable(axis="x", share=1e-3, frequency=345.0, damping=0.3)
    for hertz in (100.0, 345.0, 500.0):
        turned = np.exp(2j * np.pi * hertz * TIME)
        pull = held(cable, turned.imag, np.zeros_like(TIME), AttachedStage(5e5, 0.7)) - turned.imag
        k = np.pi * np.sqrt((hertz / 345.0) ** 2 - 2j * 0.3 * hertz / 345.0)
        settled = (1e-3 * (1.0 - k / np.tan(k)) * turned).imag
        np.testing.assert_allclose(pull[2000:], settled[2000:], atol=0.03 * np.ptp(settled))


@settings(deadline=None, max_examples=10)
@given(seed=st.integers(0, 10_000), share=st.floats(1e-4, 0.1))
def test_a_cable_without_loss_keeps_the_energy(seed: int, share: float) -> None:
    cable = Cable(0, AttachedStage(STAGE.natural, 0.0), share, 2.0 * np.pi * 345.0, 0.0)
    state = np.random.default_rng(seed).normal(0.0, 1e-6, 2 + 2 * CABLE_TERMS)
    state[1], state[2 + CABLE_TERMS :] = 0.0, 0.0

    def energy() -> float:
        bends, speeds = state[2 : 2 + CABLE_TERMS], state[2 + CABLE_TERMS :]
        stage = 0.5 * ((state[1] / STAGE.natural) ** 2 + state[0] ** 2)
        taut = np.sum((state[0] - 0.5 * np.pi * CABLE_ORDERS * bends) ** 2)
        moving = 0.25 * np.sum((np.pi * speeds / cable.natural) ** 2)
        return float(stage + share * (taut + moving))

    before = energy()
    cable.integrate(state, np.zeros((2, 4001)), STEP)
    assert energy() == pytest.approx(before, rel=1e-9)
