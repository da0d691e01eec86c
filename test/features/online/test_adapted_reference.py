"""The adapted reference undoes a shift, and its parameters change without a jump."""

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
import pytest
from attrs import evolve
from hypothesis import given, settings
from hypothesis import strategies as st

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.scanner import chain_of
from afm_scan_ros.core.streams import ACHIEVED, DRIVE, end, part
from afm_scan_ros.core.trajectory import desired, phases, total_samples
from afm_scan_ros.core.types import AXES, Array, Trace
from afm_scan_ros.features.online.adapted_reference import AxisShift, ReferenceFilter, with_shift
from afm_scan_ros.features.online.adapted_scan import AdaptedScan
from afm_scan_ros.features.online.line_correction import refuse_unsuited
from helpers.in_process import FAST_SPEC, default_model

SPEC = evolve(FAST_SPEC, preparation_cycles=2)
TARGET = desired(SPEC, 0, total_samples(SPEC))
DELAY = 2
BILINEAR = 5e-4
"""Share of the motion that the bilinear transform errs by, at 110 samples a period."""
SHIFTS = st.builds(
    AxisShift,
    gain=st.floats(0.9, 1.1),
    frequency=st.floats(0.9, 1.1),
    damping=st.floats(0.5, 2.0),
    creep=st.floats(-0.2, 0.4),
)


class Known:
    """An adaptation that knows the shift of each line without looking."""

    def __init__(self, shifts: dict[int, AxisShift]) -> None:
        self._shifts, self._lines = shifts, phases(SPEC).lines
        self._done = 0

    def add(self, drive: Trace, measured: Trace) -> Iterator[tuple[int, dict[str, AxisShift]]]:
        """Yield the lines that end with a run."""
        del drive
        stop = (end(measured) - self._lines.start) // SPEC.samples_per_line
        while self._done < min(stop, SPEC.lines):
            yield self._done, dict.fromkeys(AXES, self._shifts[self._done])
            self._done += 1


def filtered(shift: AxisShift) -> Array:
    weights = np.repeat(shift.weights[:, None], len(TARGET.x), axis=1)
    one = ReferenceFilter(default_model().axis("x"), SPEC.sample_period)
    return one.apply(one.at_rest(), TARGET.x, weights)[1]


def adapted(shifts: dict[int, AxisShift], cuts: list[int]) -> Trace:
    scan = AdaptedScan(default_model(), SPEC, Known(shifts), DELAY)
    parts: list[Trace] = []
    edges = [0, *sorted(cuts), len(TARGET.x)]
    for start, stop in pairwise(edges):
        block = part(TARGET, start, stop)
        parts += scan.corrected([block])
        scan.observe(DRIVE, block)
        scan.observe(ACHIEVED, block)
        parts += scan.corrected()
    x, y = (np.concatenate([each.axis(name) for each in parts]) for name in AXES)
    return Trace(0, SPEC.sample_period, x, y)


def test_without_a_shift_the_reference_is_what_is_desired() -> None:
    assert np.array_equal(filtered(AxisShift()), TARGET.x)


@settings(max_examples=20)
@given(SHIFTS)
def test_the_shifted_scanner_follows_the_adapted_reference_as_the_model_what_is_desired(
    shift: AxisShift,
) -> None:
    axis = default_model().axis("x")
    period = SPEC.sample_period
    shifted = chain_of(with_shift(axis, shift)).stages()
    unshifted = chain_of(axis).stages()

    def through(stages: tuple[int, ...], signal: Array, *, inverse_creep: bool) -> Array:
        creep = unshifted[2].at(period)
        if inverse_creep:
            signal = creep.invert(creep.inverse_at_rest(), signal)[1]
        for place in stages:
            cascade = shifted[place].at(period)
            signal = cascade.apply(cascade.at_rest(), signal)[1]
        return signal

    vibration = unshifted[1].at(period)
    wanted = vibration.apply(vibration.at_rest(), TARGET.x)[1]
    moved = through((1, 2, 3), filtered(shift), inverse_creep=True)
    assert np.abs(moved - wanted).max() <= BILINEAR * np.abs(wanted).max()


@settings(max_examples=20)
@given(
    st.lists(SHIFTS, min_size=SPEC.lines, max_size=SPEC.lines),
    st.lists(st.integers(0, len(TARGET.x)), max_size=5),
)
def test_any_cut_into_blocks_gives_the_same(shifts: list[AxisShift], cuts: list[int]) -> None:
    shown = dict(enumerate(shifts))
    whole, cut = adapted(shown, []), adapted(shown, cuts)
    np.testing.assert_allclose(cut.x, whole.x, rtol=0.0, atol=1e-18)
    np.testing.assert_allclose(cut.y, whole.y, rtol=0.0, atol=1e-18)


@settings(max_examples=20)
@given(SHIFTS)
def test_a_change_is_a_cross_fade_of_two_filters_in_the_turn_around(shift: AxisShift) -> None:
    shift = evolve(shift, creep=0.0)
    shown = {line: AxisShift() if line == 0 else shift for line in range(SPEC.lines)}
    found, old, new = adapted(shown, []).x, filtered(AxisShift()), filtered(shift)
    turn = round(0.5 * SPEC.turnaround * SPEC.samples_per_line)
    first = phases(SPEC).lines.start + (DELAY + 1) * SPEC.samples_per_line - turn // 2
    assert np.array_equal(found[:first], old[:first])
    np.testing.assert_allclose(found[first + turn :], new[first + turn :], rtol=0.0, atol=1e-18)
    share = np.arange(turn) / turn
    rise = share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
    fade = old[first : first + turn] + rise * (new - old)[first : first + turn]
    np.testing.assert_allclose(found[first : first + turn], fade, rtol=0.0, atol=1e-15)


@given(SHIFTS)
def test_unknowns_and_factors_belong_to_each_other(shift: AxisShift) -> None:
    found = AxisShift.of(shift.unknowns)
    assert found is not None
    np.testing.assert_allclose(found.unknowns, shift.unknowns, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize(
    "unknowns", [(-0.6, 0, 0, 0), (0, -0.6, 0, 0), (0, 0, 10, 0), (0, 0, 0, 2)]
)
def test_there_is_no_shift_beyond_the_bounds(unknowns: tuple[float, ...]) -> None:
    assert AxisShift.of(np.array(unknowns)) is None


@pytest.mark.parametrize(
    ("spec", "said"),
    [
        (ScanSpec(pattern="spiral"), "raster and sinusoidal"),
        (ScanSpec(turnaround=0.0), "turnaround = 0"),
    ],
)
def test_a_scan_without_turn_arounds_is_refused(spec: ScanSpec, said: str) -> None:
    with pytest.raises(InputError, match=said):
        refuse_unsuited("adaptation", spec)


def test_a_resonance_beyond_the_samples_is_refused() -> None:
    with pytest.raises(InputError, match="half the sample rate"):
        ReferenceFilter(default_model().axis("x"), 2e-3)
