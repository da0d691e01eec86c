"""Drives grow only while what is extrapolated stays within the limits."""

from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest
from attrs import evolve
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import lfilter

from afm_scan_ros.core.errors import ScanError
from afm_scan_ros.core.identification.drives.excitation import Plan
from afm_scan_ros.core.identification.drives.growth import (
    FACTOR,
    FIRST,
    GrowthStep,
    MeasuredResponse,
    MotionLimits,
    Watched,
    beyond,
    grow,
    next_step,
    response,
)
from afm_scan_ros.core.identification.drives.proposal import (
    ConverterLimits,
    Coverage,
    ProposedRecord,
    coverage,
    propose,
)
from afm_scan_ros.core.types import Trace
from afm_scan_ros.simulation.axis import RationalSpec
from afm_scan_ros.simulation.scanner import PlantSpec
from helpers.in_process import default_plant, drive_through

RANGE = 40e-6
LIMITS = MotionLimits.of_range(RANGE)
RESONANCE = 454.0
KNOWN = Coverage(resonance=RESONANCE, gain=12e-6, creep=1.2)
"""Of the default plant, and more: its gain is 9e-6 m/V, its creep 1.16."""
SIZE = st.floats(1e-3, 20.0)
"""Of what a scanner does at the planned amplitude, over the limit."""

Law = Callable[[float], MeasuredResponse]
"""Response of an axis to a share of the drive."""


def rayleigh(travel: tuple[float, float], excitation: tuple[float, float]) -> Law:
    """Linear and quadratic part of each, over its limit."""

    def respond(share: float) -> MeasuredResponse:
        moved, rung = (a * share + b * share**2 for a, b in (travel, excitation))
        return MeasuredResponse(LIMITS.travel * moved, 1e-6, LIMITS.excitation * rung, 0.0)

    return respond


def growth(x: Law, y: Law) -> list[Watched]:
    done: list[Watched] = []
    while not (done and done[-1].step.whole):
        step = next_step(done, LIMITS)
        done.append(Watched(step, {"x": x(step.share), "y": y(step.share)}))
    return done


LAW = st.builds(rayleigh, *[st.tuples(SIZE, st.one_of(st.just(0.0), SIZE))] * 2)


@given(LAW, LAW)
def test_no_step_but_the_first_exceeds_a_limit_and_none_skips_one(x: Law, y: Law) -> None:
    done = growth(x, y)
    assert done[0].step.share == FIRST
    assert [each.step.whole for each in done] == [False] * (len(done) - 1) + [True]
    for before, after in pairwise(done):
        assert after.step.share <= FACTOR * before.step.share
        for seen in after.responses.values():
            assert seen.travel <= LIMITS.travel * (1.0 + 1e-9)
            assert seen.excitation <= LIMITS.excitation * (1.0 + 1e-9)


@given(LAW, LAW)
def test_it_ends_at_the_plan_or_names_the_limit_that_it_reached(x: Law, y: Law) -> None:
    last = growth(x, y)[-1]
    assert (last.step.reached is None) == (last.step.share == 1.0)
    if last.step.reached is not None:
        reached = last.step.reached
        assert reached.expected > reached.limit == getattr(LIMITS, reached.quantity)
        assert last.step.share < reached.share


@given(*[st.floats(1e-3, 3.9)] * 4)
def test_what_grows_in_proportion_grows_as_far_as_it_may(
    x: float, y: float, x_rings: float, y_rings: float
) -> None:
    """Up to a first step that is a quarter of the limit."""
    last = growth(rayleigh((x, 0.0), (x_rings, 0.0)), rayleigh((y, 0.0), (y_rings, 0.0)))[-1]
    assert last.step.share == pytest.approx(1.0 / max(1.0, x, y, x_rings, y_rings))


@given(SIZE)
def test_a_sensor_that_sees_only_noise_ends_the_growth(noise: float) -> None:
    deaf = MeasuredResponse(1e-3 * LIMITS.travel * noise, 0.0, 0.0, 0.0)
    with pytest.raises(ScanError, match=r"axis y: the drive grew \d+ times, and the displacement"):
        growth(rayleigh((0.5, 0.0), (0.1, 0.0)), lambda _: deaf)


def proposed(identifies: str, have: Coverage = KNOWN) -> ProposedRecord:
    records = propose(ConverterLimits(-5.0, 5.0, 5e3), 10.0, RANGE, have)
    return next(record for record in records if record.identifies == identifies)


RECORD = proposed("hysteresis")


def grown(record: ProposedRecord, plant: PlantSpec, limits: MotionLimits = LIMITS) -> list[Watched]:
    def drive(plan: Plan, _: object) -> tuple[Trace, Trace]:
        return drive_through(plan, plant, seed=1)

    return list(grow(record, drive, limits, KNOWN))


def test_a_scanner_as_expected_is_driven_as_planned() -> None:
    last = grown(proposed("hysteresis"), default_plant())[-1]
    assert (last.step.share, last.step.reached) == (1.0, None)


def test_twice_the_expected_gain_stops_at_the_displacement_allowed() -> None:
    given = default_plant()
    x = evolve(given.x, hysteresis=evolve(given.x.hysteresis, gain=2.0 * given.x.hysteresis.gain))
    last = grown(proposed("hysteresis"), evolve(given, x=x))[-1]
    assert last.step.reached is not None
    assert (last.step.reached.axis, last.step.reached.quantity) == ("x", "travel")
    assert 0.8 * LIMITS.travel < last.responses["x"].travel < LIMITS.travel
    assert last.step.share < 0.8


def resonant(damping: float) -> PlantSpec:
    """The default plant with one resonance, of a damping, and the same steady gain."""
    given, omega = default_plant(), 2.0 * np.pi * RESONANCE
    steady = given.x.vibration.numerator[-1] / given.x.vibration.denominator[-1]
    one = RationalSpec((steady * omega**2,), (1.0, 2.0 * damping * omega, omega**2))
    return evolve(given, x=evolve(given.x, vibration=one, modes=()))


def test_a_lightly_damped_resonance_stops_at_the_excitation_allowed() -> None:
    limits = evolve(LIMITS, excitation=0.06 * RANGE)
    record = proposed("hysteresis")
    calm, ringing = (grown(record, resonant(damping), limits)[-1] for damping in (0.1, 0.003))
    assert (calm.step.share, calm.step.reached) == (1.0, None)
    assert ringing.step.reached is not None
    assert (ringing.step.reached.axis, ringing.step.reached.quantity) == ("x", "excitation")
    assert ringing.step.share < 0.8
    assert 0.4 * limits.excitation < ringing.responses["x"].excitation < 1.02 * limits.excitation


@pytest.mark.parametrize("identifies", ["resonance", "creep", "hysteresis", "error"])
def test_a_trial_goes_as_far_and_rings_as_much_as_its_record(identifies: str) -> None:
    record = proposed(identifies, Coverage() if identifies == "resonance" else KNOWN)
    peaks = []
    for plan in (record.trial, record.plan):
        drive, moved = drive_through(plan, default_plant(), seed=1)
        seen = response(drive.x, moved.x, drive.sample_period, RESONANCE)
        peaks.append((seen.travel, seen.peak))
    (travel, peak), (all_travel, all_peak) = peaks
    assert all_travel < KNOWN.creep * travel
    assert peak > 0.9 * all_peak - 0.02 * LIMITS.excitation


def test_creep_is_how_far_a_hold_goes_on() -> None:
    drive, moved = drive_through(proposed("creep").plan, default_plant(), seed=1)
    seen = coverage(drive.x, moved.x, drive.sample_period)
    assert seen.hold == pytest.approx(10.0, rel=1e-3)
    time = np.arange(len(drive.x)) * drive.sample_period
    before, early, late = (moved.x[time > each][0] for each in (4.9, 5.15, 14.9))
    assert seen.creep == pytest.approx((late - before) / (early - before), rel=0.01)


def test_exchanged_sensors_end_the_survey_which_is_small() -> None:
    def drive(plan: Plan, _: object) -> tuple[Trace, Trace]:
        given, moved = drive_through(plan, default_plant(), seed=1)
        return given, evolve(moved, x=moved.y, y=moved.x)

    record = proposed("resonance", Coverage())
    with pytest.raises(ScanError, match=r"axis x moved .* not exchanged"):
        list(grow(record, drive, LIMITS, Coverage()))


@pytest.mark.parametrize("times", [30.0, 1.0 / 30.0])
def test_records_at_hand_of_another_scanner_end_the_second_trial(times: float) -> None:
    def drive(plan: Plan, _: object) -> tuple[Trace, Trace]:
        return drive_through(plan, default_plant(), seed=1)

    known = evolve(KNOWN, gain=9e-6 * times)
    seen = grow(proposed("hysteresis"), drive, LIMITS, known)
    assert [next(seen).step.share for _ in range(2)] == [FIRST, FACTOR * FIRST]
    with pytest.raises(ScanError, match="give this scanner's"):
        next(seen)


def test_a_record_beyond_its_limits_names_each() -> None:
    seen = MeasuredResponse(1.1 * LIMITS.travel, 1e-6, 1.2 * LIMITS.excitation, 0.0)
    calm = MeasuredResponse(0.9 * LIMITS.travel, 1e-6, 0.0, 0.0)
    found = list(beyond(Watched(GrowthStep(0.5, whole=True), {"x": calm, "y": seen}), LIMITS))
    assert [(each.axis, each.quantity) for each in found] == [("y", "travel"), ("y", "excitation")]
    assert [each.expected / each.limit for each in found] == pytest.approx([1.1, 1.2])


@given(st.floats(0.3, 3.0), st.floats(0.01, 100.0), st.sampled_from([1.0, -1.0]))
def test_an_axis_may_have_another_gain_than_the_one_that_is_known(
    near: float, other: float, sign: float
) -> None:
    """As a fast stage of 5 um on a slow one of 50, or a sensor that counts the other way."""
    gains = sign * 1e-6 * np.array([near, other])

    def drive(plan: Plan, _: object) -> tuple[Trace, Trace]:
        given_ = Trace(0, plan.sample_period, plan.x, plan.y)
        return given_, evolve(given_, x=gains[0] * plan.x, y=gains[1] * plan.y)

    limits = MotionLimits(1.0, 1.0)
    assert list(grow(RECORD, drive, limits, Coverage(gain=1e-6)))[-1].step.share == 1.0


@pytest.mark.parametrize("corner", [0.3, 3.0, 30.0])
def test_a_stage_without_a_resonance_is_calibrated(corner: float) -> None:
    """Its largest response is to the slowest wave, below which there is no drive."""

    def drive(plan: Plan, _: object) -> tuple[Trace, Trace]:
        given_ = Trace(0, plan.sample_period, plan.x, plan.y)
        part = 1.0 - np.exp(-2.0 * np.pi * corner * plan.sample_period)
        x, y = (1e-6 * lfilter([part], [1.0, part - 1.0], wave) for wave in (plan.x, plan.y))
        return given_, evolve(given_, x=x, y=y)

    record = proposed("resonance", Coverage())
    assert list(grow(record, drive, LIMITS, Coverage()))[-1].step.share == 1.0
