"""What the estimator takes for a change, and what not."""

from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from attrs import evolve
from hypothesis import given, settings
from hypothesis import strategies as st

from afm_scan_ros.core.metrics import Scan
from afm_scan_ros.core.model import Added, AxisModel
from afm_scan_ros.core.scanner import predict
from afm_scan_ros.core.streams import part
from afm_scan_ros.core.trajectory import phases
from afm_scan_ros.core.types import AXES, Trace
from afm_scan_ros.features.online.adaptation import Adaptation, AxisState, Outcome
from afm_scan_ros.features.online.adapted_reference import AxisShift, with_shift
from afm_scan_ros.simulation.axis import detuned_axis
from helpers.in_process import ALL, FAST_SPEC, default_model, default_plant, scan

SPEC = evolve(FAST_SPEC, lines=40)
MEMORY = 0.1
"""Seconds: ten lines."""
NOISE = 2e-9


@cache
def scanned(frequency: float = 1.0) -> Scan:
    """Scan of the simulated scanner with another resonance."""
    plant = default_plant()
    axes = {name: detuned_axis(each, frequency, 1.0) for name, each in plant.axes().items()}
    return scan(SPEC, ALL, plant=evolve(plant, **axes))


def adapted(drive: Trace, measured: Trace) -> dict[str, AxisState]:
    adaptation = Adaptation(default_model(), SPEC, MEMORY)
    list(adaptation.add(drive, measured))
    return adaptation.states


def outcomes(state: AxisState) -> dict[str, Outcome]:
    return {name: finding.outcome for name, finding in state.findings.items()}


def imitated(axis: AxisModel, done: Scan, seed: int = 1) -> dict[str, AxisState]:
    """What is found on a scanner that is a model, with noise."""
    moved = predict(evolve(default_model(), x=axis), done.drive)
    rng = np.random.default_rng(seed)
    x, y = (moved.axis(name) + NOISE * rng.standard_normal(len(moved.x)) for name in AXES)
    return adapted(done.drive, evolve(moved, x=x, y=y))


def test_an_unchanged_scanner_is_not_adapted_to() -> None:
    for state in adapted(scanned().drive, scanned().measured).values():
        assert not state.unknowns.any()
        assert set(outcomes(state).values()) <= {Outcome.UNCHANGED, Outcome.NOT_EXCITED}


@settings(max_examples=4)
@given(st.sampled_from([0.97, 0.98, 1.02, 1.03]))
def test_a_shifted_resonance_is_found(frequency: float) -> None:
    done = scanned(frequency)
    state = adapted(done.drive, done.measured)["x"]
    assert state.shift.frequency == pytest.approx(frequency, abs=1e-3)
    assert state.shift.gain == 1.0
    assert outcomes(state)["frequency"] is Outcome.CHANGED


def test_the_same_model_error_later_is_no_change_but_a_shift_is() -> None:
    before, after = scanned(), scanned(1.002)
    half = phases(SPEC).lines.start + SPEC.lines // 2 * SPEC.samples_per_line
    x = np.concatenate((before.measured.x[:half], after.measured.x[half:]))
    state = adapted(before.drive, evolve(before.measured, x=x))["x"]
    assert state.shift.frequency == pytest.approx(1.002, abs=3e-4)
    assert adapted(after.drive, after.measured)["x"].shift.frequency == 1.0  # within the dead zone


@settings(max_examples=8)
@given(st.lists(st.integers(0, len(scanned(1.03).drive.x)), max_size=4))
def test_any_cut_into_blocks_gives_the_same(cuts: list[int]) -> None:
    done = scanned(1.03)
    whole = adapted(done.drive, done.measured)
    adaptation = Adaptation(default_model(), SPEC, MEMORY)
    edges = [0, *sorted(cuts), len(done.drive.x)]
    for start, stop in pairwise(edges):
        list(adaptation.add(part(done.drive, start, stop), part(done.measured, start, stop)))
    for name in AXES:
        found, wanted = (states[name].unknowns for states in (adaptation.states, whole))
        np.testing.assert_allclose(found, wanted, rtol=1e-9, atol=1e-12)


def test_a_scanner_that_rests_excites_nothing() -> None:
    still = np.zeros(len(scanned().drive.x))
    noise = NOISE * np.random.default_rng(1).standard_normal(len(still))
    rest = Trace(0, SPEC.sample_period, still, still)
    for state in adapted(rest, evolve(rest, x=noise, y=noise)).values():
        assert not state.unknowns.any()
        assert set(outcomes(state).values()) == {Outcome.NOT_EXCITED}


def test_a_gain_is_found() -> None:
    axis = with_shift(default_model().axis("x"), AxisShift(gain=1.02))
    state = imitated(axis, scanned())["x"]
    assert state.shift.gain == pytest.approx(1.02, abs=1e-4)
    assert outcomes(state)["frequency"] is Outcome.UNCHANGED


def test_a_gain_is_not_told_from_a_hysteresis_that_changed() -> None:
    axis = default_model().axis("x")
    looped = evolve(axis, added=(Added("parameter_shift", "hysteresis", (1.1,)),))
    state = imitated(looped, scanned())["x"]
    assert outcomes(state)["gain"] is Outcome.OTHER_CAUSE
    assert state.shift.gain == 1.0


def test_another_effect_is_not_taken_for_a_shift() -> None:
    late = evolve(default_model().axis("x"), added=(Added("delay", "", (1e-4,)),))
    state = imitated(late, scanned())["x"]
    assert not state.unknowns.any()
    assert set(outcomes(state).values()) == {Outcome.OTHER_CAUSE, Outcome.NOT_EXCITED}


def test_what_lies_beyond_the_bounds_is_not_taken() -> None:
    axis = with_shift(default_model().axis("x"), AxisShift(frequency=1.5))
    state = imitated(axis, scanned())["x"]
    assert outcomes(state)["frequency"] is Outcome.BEYOND_BOUNDS
    assert state.shift.frequency == 1.0
