"""Line-to-line feedback on streams: without deadlock, the same for any cut and any timing."""

from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest
from attrs import evolve
from hypothesis import given, settings
from hypothesis import strategies as st

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.streams import ACHIEVED, DESIRED, end, part
from afm_scan_ros.core.trajectory import (
    desired,
    phases,
    sample_kinds,
    stopped,
    stopped_total,
    total_samples,
)
from afm_scan_ros.core.types import AXES, Array, Trace
from afm_scan_ros.features.online.line_correction import lines_of_delay, turn_samples
from afm_scan_ros.features.online.line_feedback import (
    CENTRE_X,
    CENTRE_Y,
    FedBack,
    LineFit,
)

SPEC = ScanSpec(
    lines=12, line_rate=50.0, samples_per_line=200, preparation="none", approach=0.01, settle=0.01
)
Error = Callable[[Array], Array]
"""Displacement (m) that is added at samples, (2, n)."""


def drift(samples: Array) -> Array:
    return np.stack([1e-9 * samples, -2e-9 * samples])


class Chain:
    """A scanner that follows what is desired ``held_back`` and ``latency`` samples late."""

    def __init__(self, spec: ScanSpec, held_back: int, latency: int, added: Error = drift) -> None:
        self.followed: list[Trace] = []
        self._late, self._added, self._passed = held_back + latency, added, 0
        delay = lines_of_delay(spec, held_back, latency * spec.sample_period)
        self.fed_back = FedBack(spec, delay)

    def scan(self, spec: ScanSpec, cuts: set[int]) -> Trace:
        """Return what was followed."""
        edges = [0, *sorted(cuts), total_samples(spec)]
        for first, stop in pairwise(edges):
            self.follow(desired(spec, first, stop - first), last=stop == edges[-1])
        x, y = (np.concatenate([each.axis(name) for each in self.followed]) for name in AXES)
        return Trace(0, spec.sample_period, x, y)

    def follow(self, block: Trace, *, last: bool) -> None:
        """Follow a block as far as can be; all of it where it is the ``last``."""
        self.fed_back.observe(DESIRED, block)
        pending = list(self.fed_back.corrected([block]))
        while pending:
            self.followed.append(pending.pop(0))
            known = end(self.followed[-1]) - (0 if last and not pending else self._late)
            for achieved in self._achieved(known):
                self.fed_back.observe(ACHIEVED, achieved)
                pending.extend(self.fed_back.corrected())
        assert not last or self.fed_back.awaited is None

    def _achieved(self, known: int) -> list[Trace]:
        found = []
        for block in self.followed[-100:]:
            start, stop = max(self._passed, block.first_sample), min(known, end(block))
            if start < stop:
                now = part(block, start, stop)
                x, y = np.stack([now.x, now.y]) + self._added(np.arange(start, stop))
                found.append(Trace(start, now.sample_period, x, y))
                self._passed = stop
        return found


def errors(spec: ScanSpec, followed: Trace, added: Error) -> Array:
    """Error (m) on the lines, (2, lines, samples)."""
    total = np.arange(total_samples(spec))
    target = desired(spec, 0, len(total))
    error = np.stack([followed.x - target.x, followed.y - target.y]) + added(total)
    where = phases(spec).lines
    return error[:, where.start : where.stop].reshape(2, spec.lines, -1)


@given(
    rate=st.sampled_from([1.0, 5.0, 30.0, 100.0, 250.0]),
    held_back=st.integers(0, 300),
    latency=st.integers(0, 300),
    block=st.integers(20, 700),
    turnaround=st.floats(0.01, 0.9),
)
@settings(deadline=None, max_examples=30)
def test_no_line_waits_for_what_cannot_be_measured_yet(
    rate: float, held_back: int, latency: int, block: int, turnaround: float
) -> None:
    period = 1.0 / (rate * SPEC.samples_per_line)
    times = {"approach": 20 * period, "settle": 400 * period, "y_step": period}
    spec = evolve(SPEC, line_rate=rate, turnaround=turnaround, **times)
    followed = Chain(spec, held_back, latency).scan(spec, set(range(block, 2000, block)))
    assert followed.x.size == total_samples(spec)


@given(stop=st.integers(0, total_samples(SPEC) - 1), size=st.integers(30, 500))
@settings(deadline=None, max_examples=20)
def test_a_scan_that_is_stopped_is_followed_to_its_end(stop: int, size: int) -> None:
    chain, total = Chain(SPEC, 30, 100), stopped_total(SPEC, stop)
    for first in range(0, total, size):
        block = stopped(SPEC, stop, first, min(size, total - first))
        chain.follow(block, last=end(block) == total)
    assert end(chain.followed[-1]) == total


@given(cuts=st.sets(st.integers(1, total_samples(SPEC) - 1), max_size=12))
@settings(deadline=None, max_examples=25)
def test_neither_blocks_nor_timing_change_a_bit(cuts: set[int]) -> None:
    whole = Chain(SPEC, 30, 100).scan(SPEC, set())
    delay = lines_of_delay(SPEC, 30, 100 * SPEC.sample_period)
    assert delay == lines_of_delay(SPEC, 0, 130 * SPEC.sample_period)
    for chain in (Chain(SPEC, 30, 100), Chain(SPEC, 0, 130)):
        cut = chain.scan(SPEC, cuts)
        np.testing.assert_array_equal(cut.x, whole.x)
        np.testing.assert_array_equal(cut.y, whole.y)


@pytest.mark.parametrize("pattern", ["raster", "sinusoidal"])
def test_a_steady_drift_and_a_wrong_gain_are_followed(pattern: str) -> None:
    spec = evolve(SPEC, pattern=pattern, lines=20)
    target = desired(spec, 0, total_samples(spec))

    def added(samples: Array) -> Array:
        return drift(samples) + np.stack([0.01 * target.x[samples.astype(int)], 0.0 * samples])

    left = errors(spec, Chain(spec, 30, 20, added).scan(spec, {777}), added)
    kinds = sample_kinds(spec, phases(spec).lines.start, spec.samples_per_line)
    steady = kinds.trace | kinds.retrace
    before, after = left[:, 0, steady], left[:, 12:][:, :, steady]
    assert np.abs(before).max() > 3e-8
    np.testing.assert_allclose(after, 0.0, atol=1e-13)


def test_the_correction_of_the_last_line_is_stated() -> None:
    chain = Chain(SPEC, 30, 20)
    chain.scan(SPEC, set())
    middle = np.array([0.5, 0.25]) * SPEC.samples_per_line + phases(SPEC).lines.start
    x, y = np.diag(drift(middle + (SPEC.lines - 1) * SPEC.samples_per_line))
    assert chain.fed_back.corrected_by() == pytest.approx({"x": -x, "y": -y}, abs=1e-9)
    assert chain.fed_back.effect() == "line feedback corrects x by -2.4 µm, y by 4.7 µm"


def test_a_correction_changes_in_the_turn_around_alone_and_without_a_jump() -> None:
    def added(samples: Array) -> Array:
        steps = np.floor(samples / 700.0)
        return np.stack([2e-9 * np.sin(9.0 * steps), 1e-9 * np.cos(5.0 * steps)])

    followed = Chain(SPEC, 30, 20, added).scan(SPEC, set())
    target = desired(SPEC, 0, total_samples(SPEC))
    where = phases(SPEC).lines
    kinds = sample_kinds(SPEC, where.start, SPEC.samples_per_line)
    shape = target.x[where.start : where.start + SPEC.samples_per_line] / SPEC.range_x
    time = np.arange(SPEC.samples_per_line) / SPEC.samples_per_line
    steady = kinds.trace | kinds.retrace
    basis = np.stack([np.ones_like(time), time, shape])[:, steady].T
    for line in range(SPEC.lines):
        run = slice(where.start + line * len(time), where.start + (line + 1) * len(time))
        for name in AXES:
            correction = (followed.axis(name) - target.axis(name))[run][steady]
            rest = correction - basis @ np.linalg.lstsq(basis, correction, rcond=None)[0]
            np.testing.assert_allclose(rest, 0.0, atol=1e-18)
    moved = np.diff(followed.x - target.x)
    largest = np.ptp(followed.x - target.x)
    assert 0.0 < np.abs(moved).max() <= 2.0 * largest / turn_samples(SPEC)


@given(coefficients=st.lists(st.floats(-1e-6, 1e-6), min_size=5, max_size=5))
@settings(deadline=None, max_examples=20)
def test_the_fit_finds_offset_tilt_and_gain(coefficients: list[float]) -> None:
    ox, tx, gx, oy, ty = coefficients
    start = phases(SPEC).lines.start
    shape = desired(SPEC, start, SPEC.samples_per_line).x / SPEC.range_x
    time = np.arange(SPEC.samples_per_line) / SPEC.samples_per_line
    error = np.stack([ox + tx * (time - CENTRE_X) + gx * shape, oy + ty * (time - CENTRE_Y)])
    np.testing.assert_allclose(LineFit(SPEC).coefficients(error), coefficients, atol=1e-18)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"pattern": "spiral"}, "raster and sinusoidal scans, not 'spiral'"),
        ({"turnaround": 0.0}, "turnaround = 0 leaves"),
        ({"samples_per_line": 8, "turnaround": 0.9, "y_step": 0.005}, "samples at constant speed"),
    ],
)
def test_scans_without_lines_or_turn_arounds_are_refused(
    change: dict[str, object], said: str
) -> None:
    with pytest.raises(InputError, match=said):
        LineFit(evolve(SPEC, **change))
