"""The mechanisms of opened_sizes.py of the fourth set, each against its equation's solution."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.polynomial import Polynomial
from scipy import integrate, signal

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.creep import series
from afm_scan_ros.simulation.mechanisms import loose_contact
from afm_scan_ros.simulation.mechanisms.attachment import Stage
from afm_scan_ros.simulation.mechanisms.base import Insert
from afm_scan_ros.simulation.mechanisms.flickering_reference import FlickeringReference
from afm_scan_ros.simulation.mechanisms.flooded_joint import FILM, FloodedJoint
from afm_scan_ros.simulation.mechanisms.glued_mirror import GluedMirror
from afm_scan_ros.simulation.mechanisms.loose_contact import LooseContact
from afm_scan_ros.simulation.mechanisms.resistive_electrode import ResistiveElectrode
from afm_scan_ros.simulation.mechanisms.single_ended_amplifier import (
    SUPPLY,
    SingleEndedAmplifier,
)
from afm_scan_ros.simulation.mechanisms.snapping_leaf import SNAP, SnappingLeaf
from afm_scan_ros.simulation.mechanisms.soldered_joint import REACH, SolderedJoint
from afm_scan_ros.simulation.mechanisms.warmed_piezo import WarmedPiezo
from afm_scan_ros.simulation.mechanisms.yawing_stage import FLEXURES, YawingStage
from afm_scan_ros.simulation.spec import PlantSpec

STEP = 5e-6
STAGE = Stage(2.0 * np.pi * 454.0, 0.012)
WAVE = 10e-6 * np.sin(np.arange(4000) * 2.0 * np.pi / 1000.0)
TIME = STEP * np.arange(WAVE.size)
S = Polynomial([0.0, 1.0])


def act(
    insert: Insert, own: Array, other: Array | None = None, seed: int = 0, step: float = STEP
) -> Array:
    state = insert.at_rest(step, np.random.default_rng(seed))
    return insert.act(state, own, np.zeros_like(own) if other is None else other, step)[1]


def answer(above: Polynomial, below: Polynomial) -> Array:
    """What a transfer function makes of the wave, which runs straight within a step."""
    return np.asarray(signal.lsim((above.coef[::-1], below.coef[::-1]), WAVE, TIME)[1])


def test_a_stage_yaws_as_its_transfer_function_says() -> None:
    yaw, natural = YawingStage(axis="x", share=0.02, frequency=300.0, damping=0.05), 600.0 * np.pi
    mode = S**2 + 0.1 * natural * S + natural**2
    pushed = 0.02 * natural**2 * (1.0 + S**2 / FLEXURES**2)
    read = act(yaw, WAVE[::-1].copy(), WAVE) - WAVE[::-1]
    np.testing.assert_allclose(read, answer(pushed, mode), atol=1e-12 * 1e-6)


def mirrored(mirror: GluedMirror) -> Array:
    attached = mirror.attached(STAGE)
    both = np.vstack((WAVE, np.zeros(WAVE.size)))
    return attached.apply(attached.at_rest(STEP, np.random.default_rng(0)), both, STEP)[1][0]


def test_a_mirror_pulls_as_zeners_solid_says() -> None:
    """As a complex stiffness: the glue's spring beside a spring and a dashpot in series."""
    mirror = GluedMirror(axis="x", mass_ratio=0.2, frequency=600.0, relaxing=0.4, settling=1e-3)
    natural = 2.0 * np.pi * 600.0
    stiff, slow = natural**2 * (1.0 + 1.4e-3 * S), 1.0 + 1e-3 * S
    stage = S**2 + 2.0 * STAGE.damping * STAGE.natural * S + STAGE.natural**2
    free = stage * (stiff + slow * S**2)
    expected = answer(free, free + 0.2 * stiff * S**2)
    np.testing.assert_allclose(mirrored(mirror), expected, atol=1e-10 * 1e-6)


def test_charge_diffuses_along_an_electrode() -> None:
    """Against a ladder of many resistors and capacitors, under a drive that is held."""
    cells, constant = 400, 1e-4
    ladder = np.diag(np.full(cells, 2.0)) - np.eye(cells, k=1) - np.eye(cells, k=-1)
    ladder[0, 0], ladder[-1, -1] = 3.0, 1.0  # half a resistor from the wire; an open end
    rates, shapes = np.linalg.eigh(ladder * cells**2 / constant)
    shares = shapes.sum(axis=0) ** 2 / cells
    ends = STEP * np.arange(61)
    charged = ends - (shares / rates) @ -np.expm1(-np.outer(rates, ends))
    electrode = ResistiveElectrode(axis="x", resistance=1e3, capacitance=1e-7)
    np.testing.assert_allclose(act(electrode, np.ones(60)), np.diff(charged) / STEP, atol=6e-3)
    np.testing.assert_allclose(
        act(electrode, np.ones(60))[10:], (np.diff(charged) / STEP)[10:], atol=1e-5
    )


def test_an_electrode_is_late_by_a_third_of_its_time_constant() -> None:
    late = TIME - act(ResistiveElectrode(axis="x", resistance=1500.0, capacitance=1e-7), TIME)
    assert late[-1] == pytest.approx(50e-6, rel=1e-5)


def test_solder_creeps_by_the_cube_of_its_stress() -> None:
    joint = SolderedJoint(axis="x", share=0.5, settling=2e-3)

    def creep(t: float, z: Array) -> Array:
        return np.asarray((np.interp(t, TIME, WAVE) - z) ** 3 / (2e-3 * REACH**2))

    found = integrate.solve_ivp(
        creep, (0.0, TIME[-1]), [0.0], "DOP853", TIME, max_step=STEP, rtol=1e-9, atol=1e-15
    )
    np.testing.assert_allclose(act(joint, WAVE), WAVE + 0.5 * found.y[0], atol=1e-13)


def test_films_take_the_sample_along_as_reynolds_says() -> None:
    joint, gap, travel = FloodedJoint(axis="x", gap=1e-7), 1e-7, np.linspace(0.0, 3e-7, 301)

    def follow(x: float, sample: Array) -> Array:
        thickness = 1.0 - (x - sample) / gap
        return np.asarray(FILM / (thickness**3 + FILM))

    forth = integrate.solve_ivp(
        follow, (0.0, 3e-7), [0.0], "DOP853", travel, rtol=1e-10, atol=1e-16
    )
    np.testing.assert_allclose(act(joint, travel), forth.y[0], atol=1e-14)
    there_and_back = act(joint, np.concatenate((travel, travel[::-1])))
    lost = there_and_back[:301][::-1] - there_and_back[301:]
    assert lost[-1] < 0.0 < gap < -lost.min() < 2.0 * gap


@settings(deadline=None, max_examples=20)
@given(seed=st.integers(0, 10_000), gap=st.floats(1e-9, 1e-5))
def test_a_flooded_joint_knows_no_speed_and_never_touches(seed: int, gap: float) -> None:
    rng = np.random.default_rng(seed)
    turns = np.cumsum(rng.normal(0.0, 1e-6, 50))
    fine = np.interp(np.arange(0.0, 49.01, 0.1), np.arange(50), turns)
    joint = FloodedJoint(axis="x", gap=gap)
    sample = act(joint, fine)
    np.testing.assert_allclose(sample[::10], act(joint, turns), atol=1e-9 * 1e-6)
    assert np.all(np.abs(fine - sample) < gap)


def test_a_single_ended_amplifier_rises_at_once_and_falls_as_its_resistor_lets_it() -> None:
    amplifier = SingleEndedAmplifier(axis="x", pull=1e3, capacitance=1e-7)
    out = act(amplifier, np.repeat([2.0, -1.0, 1.0], 40))
    np.testing.assert_allclose(out[:40], 2.0)
    np.testing.assert_allclose(out[80:], 1.0)
    fine = np.linspace(0.0, 40 * STEP, 40_001)
    falling = np.maximum((2.0 + SUPPLY) * np.exp(-fine / 1e-4) - SUPPLY, -1.0)
    mean = [integrate.trapezoid(falling[1000 * k : 1000 * k + 1001]) / 1000 for k in range(40)]
    np.testing.assert_allclose(out[40:80], mean, atol=1e-6)


@settings(deadline=None, max_examples=50)
@given(seed=st.integers(0, 10_000), pull=st.floats(1.0, 1e6))
def test_a_piezo_that_discharges_is_never_below_the_drive(seed: int, pull: float) -> None:
    drive = np.random.default_rng(seed).uniform(-5.0, 5.0, 200)
    amplifier = SingleEndedAmplifier(axis="x", pull=pull, capacitance=1e-7)
    out = act(amplifier, drive)
    assert np.all(out >= drive - 1e-12)
    assert np.all(out <= np.maximum.accumulate(np.maximum(drive, 0.0)) + 1e-12)


def test_a_warm_piezo_moves_further_and_creeps_sooner(plant: PlantSpec) -> None:
    warm = WarmedPiezo(axis="x", kelvin=10.0).altered(plant.x)
    (gains, taus), (before, slower) = series(warm.creep), series(plant.x.creep)
    np.testing.assert_allclose(gains, before, rtol=1e-6)
    np.testing.assert_allclose(slower / taus, 2.17, rtol=1e-3)  # exp(6963 K (1/295 K - 1/305 K))
    further = np.array(warm.vibration.numerator) / plant.x.vibration.numerator
    np.testing.assert_allclose(further, 1.015)


def test_a_reference_flickers_alike_in_every_octave_and_not_at_zero() -> None:
    flickering, count = FlickeringReference(axis="x", amplitude=0.01), 8000
    gains = [act(flickering, np.ones(count), seed=seed, step=1.0 / count) for seed in range(20)]
    power = 2.0 * np.mean(np.abs(np.fft.rfft(gains)) ** 2, axis=0) / count**2  # 1 Hz apart
    assert power[1:].sum() == pytest.approx(1e-4, rel=0.15)
    octaves = [power[low : 2 * low].sum() for low in (10, 40, 160, 640)]
    expected = 1e-4 * np.log(2.0) / np.log(2000.0 / 0.5)
    np.testing.assert_allclose(octaves, expected, rtol=0.4)  # 100 tones or so, by chance
    assert not act(flickering, np.zeros(100)).any()


@pytest.mark.parametrize("seed", range(3))
def test_a_piezo_without_a_lead_keeps_its_voltage(seed: int) -> None:
    """Against its story told instant by instant."""
    contact, drive = LooseContact(axis="x", opened=300e-6), np.cumsum(np.ones(2000))
    _, _, changes = contact.at_rest(STEP, np.random.default_rng(seed))
    fine = STEP * (np.arange(2000 * 50) + 0.5) / 50
    count = np.searchsorted(changes, fine)
    opening = np.maximum(count - 1, 0)
    instant = np.where(count % 2 == 1, changes[opening], fine)
    told = drive[(instant / STEP).astype(int)].reshape(2000, 50).mean(axis=1)
    held = act(contact, drive, seed=seed)
    assert np.abs(held - drive).max() > 50.0
    np.testing.assert_allclose(held, told, atol=np.abs(held - drive).max() / 40)  # an edge
    assert np.abs(held - told).mean() < 0.1


def test_a_contact_that_has_opened_as_often_as_it_will_is_refused(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(loose_contact, "OPENINGS", 3)
    with pytest.raises(InputError, match="outlasts 3 openings"):
        act(LooseContact(axis="x", opened=1e-6), np.zeros(40_000))


def test_a_leaf_snaps_where_its_rest_ends() -> None:
    leaf, there = SnappingLeaf(axis="x", throw=1e-7, reach=1e-5), np.linspace(-9e-6, 9e-6, 200_000)
    path = np.concatenate((np.linspace(0.0, -9e-6, 1000), there, there[::-1]))
    w = (act(leaf, path) - path) / 1e-7 - 1.0
    up, down = w[1000:201_000], w[201_000:][::-1]
    fold = 2.0 / np.sqrt(27.0) * 1e-5
    snaps = there[np.argmax(up > 0.0)], -there[np.argmax(down > 0.0)]
    np.testing.assert_array_less(fold, snaps)
    np.testing.assert_array_less(snaps, 1.05 * fold)  # it takes its time to leave where it was


def test_a_leaf_follows_its_equation() -> None:
    leaf = SnappingLeaf(axis="x", throw=1e-7, reach=1e-5)

    def snap(t: float, w: Array) -> Array:
        return np.asarray((w - w**3 + np.interp(t, TIME, WAVE) / 1e-5) / SNAP)

    found = integrate.solve_ivp(
        snap, (0.0, TIME[-1]), [-1.0], "DOP853", TIME, max_step=STEP, rtol=1e-9, atol=1e-12
    )
    np.testing.assert_allclose(act(leaf, WAVE), WAVE + 1e-7 * (found.y[0] + 1.0), atol=1e-13)


def test_without_size_they_leave_everything_as_it_was(plant: PlantSpec) -> None:
    for none in (
        YawingStage(axis="x", share=0.0, frequency=300.0, damping=0.05),
        SolderedJoint(axis="x", share=0.0, settling=1.0),
        FloodedJoint(axis="x", gap=1e-20),
        ResistiveElectrode(axis="x", resistance=1e-9, capacitance=1e-9),
        SingleEndedAmplifier(axis="x", pull=1e-9, capacitance=1e-9),
        FlickeringReference(axis="x", amplitude=0.0),
        LooseContact(axis="x", opened=0.0),
        SnappingLeaf(axis="x", throw=0.0, reach=1e-5),
    ):
        np.testing.assert_allclose(act(none, WAVE, WAVE[::-1].copy()), WAVE, atol=1e-19)
    mirror = GluedMirror(axis="x", mass_ratio=0.0, frequency=600.0, relaxing=0.4, settling=1e-3)
    np.testing.assert_array_equal(mirrored(mirror), WAVE)
    cold = WarmedPiezo(axis="x", kelvin=0.0).altered(plant.x)
    assert cold.vibration == plant.x.vibration
    np.testing.assert_allclose(cold.creep.numerator, plant.x.creep.numerator, rtol=1e-9)
