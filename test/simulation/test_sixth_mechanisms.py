"""The mechanisms of opened_sizes.py of the sixth set, each against its equation's solution."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import integrate

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.dynamics import Dynamics, first_resonance
from afm_scan_ros.simulation.mechanisms import miscounting_encoder
from afm_scan_ros.simulation.mechanisms.attachment import Stage
from afm_scan_ros.simulation.mechanisms.base import Insert
from afm_scan_ros.simulation.mechanisms.ceramic_filter import KNEE, CeramicFilter
from afm_scan_ros.simulation.mechanisms.cracked_leaf import CrackedLeaf
from afm_scan_ros.simulation.mechanisms.draining_pad import DrainingPad
from afm_scan_ros.simulation.mechanisms.miscounting_encoder import SPACING, MiscountingEncoder
from afm_scan_ros.simulation.mechanisms.round_hole import RoundHole
from afm_scan_ros.simulation.mechanisms.scratched_plate import ANGLE, OFFSET, SPOT, ScratchedPlate
from afm_scan_ros.simulation.mechanisms.self_heating_amplifier import (
    SUPPLY,
    SelfHeatingAmplifier,
)
from afm_scan_ros.simulation.mechanisms.touched_stop import REACH, TouchedStop
from afm_scan_ros.simulation.spec import PlantSpec

STEP = 5e-6
STAGE = Stage(2.0 * np.pi * 454.0, 0.012)
WAVE = 10e-6 * np.sin(np.arange(4000) * 2.0 * np.pi / 1000.0)
TIME = STEP * np.arange(WAVE.size)


def act(
    insert: Insert, own: Array, other: Array | None = None, seed: int = 0, step: float = STEP
) -> Array:
    state = insert.at_rest(step, np.random.default_rng(seed))
    return insert.act(state, own, np.zeros_like(own) if other is None else other, step)[1]


def capacitance(v: Array | float) -> Array:
    return np.asarray(10e-9 / np.cbrt(1.0 + (v / KNEE) ** 2))


def test_a_ceramic_capacitor_charges_as_johnson_says() -> None:
    """Against scipy's solver, step by step of the drive: mean over each."""
    drive, resistance = np.repeat([4.0, -2.0, 0.5], 30), 2e4
    means, voltage = [], 0.0
    for u in drive:
        found = integrate.solve_ivp(
            lambda _, s, u=u: [(u - s[0]) / (resistance * capacitance(s[0])), s[0]],
            (0.0, STEP),
            [voltage, 0.0],
            rtol=1e-9,
            atol=1e-12,
        )
        voltage = found.y[0, -1]
        means.append(found.y[1, -1] / STEP)
    ceramic = CeramicFilter(axis="x", resistance=resistance, capacitance=10e-9)
    np.testing.assert_allclose(act(ceramic, drive), means, atol=1e-3)


@settings(deadline=None, max_examples=20)
@given(level=st.floats(-5.0, 5.0))
def test_a_ceramic_filter_is_late_by_what_capacitance_is_left(level: float) -> None:
    slope = 1e-2 / STEP  # V/s, for as long as a few time constants
    drive = level + slope * (TIME[:400] - TIME[399])
    ceramic = CeramicFilter(axis="x", resistance=5e3, capacitance=10e-9)
    late = (drive[-1] + 0.5 * slope * STEP - act(ceramic, drive)[-1]) / slope - 0.5 * STEP
    behind = capacitance(level - slope * 5e3 * capacitance(level))
    assert late == pytest.approx(5e3 * behind, rel=0.06)


def test_a_pad_settles_as_its_water_drains() -> None:
    """Against a column of many layers, of which each passes its water on to the next."""
    layers, draining = 300, 2e-3
    column = np.diag(np.full(layers, 2.0)) - np.eye(layers, k=1) - np.eye(layers, k=-1)
    column[0, 0], column[-1, -1] = 3.0, 1.0  # half a layer from the drain; a closed end
    rates, shapes = np.linalg.eigh(column * layers**2 / draining)
    shares = shapes.sum(axis=0) ** 2 / layers
    steps, pace = np.exp(-rates * STEP), np.diff(WAVE, prepend=0.0) / STEP
    pressure, settled = np.zeros(layers), []
    for speed in pace:
        pressure = steps * pressure + speed * (1.0 - steps) / rates
        settled.append(shares @ pressure)
    expected = WAVE + 0.5 * (WAVE - settled)
    pad = DrainingPad(axis="x", share=0.5, draining=draining)
    np.testing.assert_allclose(act(pad, WAVE), expected, atol=2e-5 * 1e-6)


@pytest.mark.parametrize("degree", [0.05, 0.2, 0.5])
def test_a_loaded_pad_settles_by_the_root_of_time_at_first(degree: float) -> None:
    pad, time = DrainingPad(axis="x", share=1.0, draining=1.0), 0.25 * np.pi * degree**2
    given_way = act(pad, np.ones(1001), step=time / 1000)[-1] - 1.0
    assert given_way == pytest.approx(degree, rel=5e-3)


def test_a_holder_is_swept_along_by_the_pin() -> None:
    """Against Moreau's catching up, which takes the nearest place left after each small step."""
    gap = 3e-6
    x, y = WAVE[:1500], 6e-6 * np.cos(np.arange(1500) / 130.0) - 6e-6
    fine = np.linspace(0, 1499, 1499 * 100 + 1)
    holder, caught = 0.0j, []
    for pin in np.interp(fine, np.arange(1500), x) + 1j * np.interp(fine, np.arange(1500), y):
        away = pin - holder
        holder = pin - away * min(1.0, gap / max(abs(away), 1e-30))
        caught.append(holder.real)
    np.testing.assert_allclose(act(RoundHole(axis="x", gap=gap), x, y), caught[::100], atol=2e-9)


@settings(deadline=None, max_examples=20)
@given(seed=st.integers(0, 10_000), gap=st.floats(1e-9, 1e-5))
def test_a_round_hole_knows_no_speed_and_is_a_play_along_one_axis(seed: int, gap: float) -> None:
    rng = np.random.default_rng(seed)
    turns, across = np.cumsum(rng.normal(0.0, 1e-6, (2, 50)), axis=1)
    fine = np.arange(0.0, 49.01, 0.1)
    joint, known = RoundHole(axis="x", gap=gap), np.arange(50)
    slowly = act(joint, np.interp(fine, known, turns), np.interp(fine, known, across))
    np.testing.assert_allclose(slowly[::10], act(joint, turns, across), atol=1e-9 * 1e-6)
    assert np.all(np.abs(turns - slowly[::10]) <= gap * (1.0 + 1e-9))
    place, played = 0.0, []
    for x in turns:
        place = min(max(place, x - gap), x + gap)
        played.append(place)
    np.testing.assert_allclose(act(joint, turns), played, atol=1e-18)


def stopped(stop: TouchedStop, path: Array, stage: Stage = STAGE) -> Array:
    attached, both = stop.attached(stage), np.vstack((path, np.zeros(path.size)))
    return attached.apply(attached.at_rest(STEP, np.random.default_rng(0)), both, STEP)[1][0]


def test_a_stage_comes_to_its_stop_and_goes_as_hertz_says() -> None:
    push, place, natural = 5e-6, 4e-6, STAGE.natural

    def swing(t: float, s: Array) -> list[float]:
        beyond = max(float(np.interp(t, TIME, WAVE)) + s[0] - place, 0.0)
        held = -push * (beyond / REACH) ** 1.5 - s[0]
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
    held = stopped(TouchedStop(axis="x", place=5e-6, push=push), path, Stage(1e5, 0.7))[-1]
    pressed = max(held - 5e-6, 0.0)
    assert free - held == pytest.approx(push * (pressed / REACH) ** 1.5, abs=1e-12)


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


def test_an_output_stage_heats_the_input_stage() -> None:
    drive = 12.0 * np.sin(TIME[:600] / 3e-4)
    amplifier = SelfHeatingAmplifier(axis="x", offset=0.1, settling=1e-3)

    def warm(t: float, s: Array) -> list[float]:
        held = abs(drive[min(int(t / STEP), 599)])
        return [(held * (SUPPLY - held) / (0.5 * SUPPLY) ** 2 - s[0]) / 1e-3, s[0]]

    found = integrate.solve_ivp(
        warm, (0.0, TIME[600]), [0.0, 0.0], t_eval=TIME[:601], max_step=0.5 * STEP
    )
    mean = np.diff(found.y[1]) / STEP
    np.testing.assert_allclose(act(amplifier, drive) - drive, 0.1 * mean, atol=1e-4)
    half = act(amplifier, np.full(20_000, -0.5 * SUPPLY))
    assert half[-1] == pytest.approx(0.1 - 0.5 * SUPPLY)


@settings(deadline=None, max_examples=20)
@given(along=st.floats(-20e-6, 20e-6), across=st.floats(-8e-6, 8e-6))
def test_a_scratch_is_as_deep_all_along(along: float, across: float) -> None:
    plate = ScratchedPlate(axis="x", depth=1e-7)
    x = (OFFSET + across) * np.cos(ANGLE) - along * np.sin(ANGLE)
    y = (OFFSET + across) * np.sin(ANGLE) + along * np.cos(ANGLE)
    read = act(plate, np.array([0.0, x]), np.array([0.0, y]))
    rest = np.exp(-0.5 * (OFFSET / SPOT) ** 2)
    assert read[0] == 0.0
    depth = 1e-7 * (np.exp(-0.5 * (across / SPOT) ** 2) - rest)
    assert read[1] - x == pytest.approx(depth, abs=1e-18)


@pytest.mark.parametrize("seed", range(3))
def test_an_encoder_misses_marks_by_chance_and_in_its_direction(seed: int) -> None:
    """Against its story told miss by miss."""
    encoder = MiscountingEncoder(axis="x", mark=1e-7)
    *_, misses = encoder.at_rest(STEP, np.random.default_rng(seed))
    assert np.diff(misses).mean() == pytest.approx(SPACING, rel=1e-2)
    path = np.tile(WAVE, 5)
    travelled, missed, told = 0.0, 0, []
    for before, after in zip(np.append(0.0, path[:-1]), path, strict=True):
        travelled += abs(after - before)
        while travelled > misses[len(told)]:
            told.append(1 if after > before else -1)
    missed = np.round((path - act(encoder, path, seed=seed)) / 1e-7).astype(int)
    jumps = np.diff(missed, prepend=0)
    np.testing.assert_array_equal(jumps[jumps != 0], told)
    assert len(told) > 10


def test_an_encoder_that_has_missed_as_often_as_it_will_is_refused(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(miscounting_encoder, "MISSES", 1)
    with pytest.raises(InputError, match="outlasts 1 missed marks"):
        act(MiscountingEncoder(axis="x", mark=1e-9), np.tile(WAVE, 10))


def test_without_size_they_leave_everything_as_it_was(plant: PlantSpec) -> None:
    for none in (
        CeramicFilter(axis="x", resistance=1e-9, capacitance=1e-9),
        DrainingPad(axis="x", share=0.0, draining=1.0),
        RoundHole(axis="x", gap=1e-20),
        SelfHeatingAmplifier(axis="x", offset=0.0, settling=1e-3),
        ScratchedPlate(axis="x", depth=0.0),
        MiscountingEncoder(axis="x", mark=0.0),
    ):
        np.testing.assert_allclose(act(none, WAVE, WAVE[::-1].copy()), WAVE, atol=1e-19)
    np.testing.assert_array_equal(stopped(TouchedStop(axis="x", place=1e-6, push=0.0), WAVE), WAVE)
    whole = CrackedLeaf(axis="x", loss=0.0).altered(plant.x).vibration
    np.testing.assert_allclose(whole.numerator, plant.x.vibration.numerator, rtol=1e-9)
