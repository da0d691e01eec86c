"""The image of a path: the sample itself where the path is as desired, however it is cut."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.image_lines import Frame, LineImager, frame_of, pixel_means
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.trajectory import desired, phases
from afm_scan_ros.core.types import Array

SPEC = ScanSpec(line_rate=50.0, lines=4, samples_per_line=400, turnaround=0.3, preparation="none")
LINES = phases(SPEC).lines
PATH = desired(SPEC, LINES.start, len(LINES))


def images(spec: ScanSpec, x: Array, values: Array, pixels: int) -> tuple[Array, Array]:
    lines = list(LineImager(spec, frame_of(spec, pixels)).add(x, values))
    assert [line.number for line in lines] == list(range(spec.lines))
    return np.stack([line.trace for line in lines]), np.stack([line.retrace for line in lines])


@given(st.integers(3, 150), st.floats(-1.0, 1.0), st.floats(-1.0, 1.0), st.floats(0.0, 0.3))
@settings(deadline=None)
def test_a_perfect_path_shows_a_slope_as_it_is(
    pixels: int, level: float, slope: float, overscan: float
) -> None:
    spec = ScanSpec(
        line_rate=50.0, lines=2, samples_per_line=1000, turnaround=0.2, overscan=overscan
    )
    path = desired(spec, phases(spec).lines.start, len(phases(spec).lines))
    centres = frame_of(spec, pixels).centres
    for image in images(spec, path.x, level + slope * path.x, pixels):
        shown = image[:, 1:-1]  # the line's ends may cover the outer pixels in part
        expected = np.broadcast_to(level + slope * centres[1:-1], shown.shape)
        np.testing.assert_allclose(shown, expected, rtol=1e-9, atol=1e-12)
    assert centres[0] > -(0.5 - overscan) * spec.range_x
    assert centres[-1] < (0.5 - overscan) * spec.range_x


@given(st.sets(st.integers(1, len(LINES) - 1)), st.integers(0, 99))
@settings(deadline=None)
def test_lines_do_not_depend_on_blocks(inner: set[int], seed: int) -> None:
    values = np.random.default_rng(seed).normal(size=len(LINES))
    imager = LineImager(SPEC, frame_of(SPEC, 50))
    cuts = pairwise([0, *sorted(inner), len(LINES)])
    lines = [line for a, b in cuts for line in imager.add(PATH.x[a:b], values[a:b])]
    trace, retrace = images(SPEC, PATH.x, values, 50)
    np.testing.assert_array_equal([line.trace for line in lines], trace)
    np.testing.assert_array_equal([line.retrace for line in lines], retrace)


def test_what_the_two_ways_differ_by_is_seen() -> None:
    lag = 5
    late = np.concatenate([np.full(lag, PATH.x[0]), PATH.x[:-lag]])
    trace, retrace = images(SPEC, PATH.x, late, 50)
    middle = slice(10, 40)
    speed = np.abs(np.diff(PATH.x)).max()
    np.testing.assert_allclose((retrace - trace)[:, middle], 2.0 * lag * speed, rtol=1e-6)


@given(st.lists(st.floats(0.01, 1.0), min_size=3, max_size=30), st.integers(1, 40))
@settings(deadline=None)
def test_pixels_keep_the_mean(steps: list[float], pixels: int) -> None:
    position = np.cumsum([0.0, *steps])
    values = np.sin(np.arange(len(position)))
    frame = Frame(0.0, float(position[-1]), pixels)
    mean = np.sum(np.diff(position) * 0.5 * (values[1:] + values[:-1])) / position[-1]
    assert pixel_means(position, values, frame).mean() == pytest.approx(mean, abs=1e-12)


def test_more_pixels_than_samples_are_refused() -> None:
    with pytest.raises(InputError, match="pixels = 200: a trace has 200 samples"):
        frame_of(SPEC, 200)


def test_a_pattern_without_lines_is_refused() -> None:
    with pytest.raises(InputError, match="pattern 'spiral' has no lines"):
        frame_of(ScanSpec(pattern="spiral"), 100)


@given(st.integers(2, 40), st.floats(0.02, 0.98))
def test_a_pixel_that_the_path_does_not_reach_is_nan(pixels: int, reach: float) -> None:
    frame = Frame(0.0, 1.0, pixels)
    means = pixel_means(np.array([0.0, reach]), np.array([1.0, 1.0]), frame)
    reached = frame.edges[:-1] < reach
    np.testing.assert_allclose(means[reached], 1.0, rtol=1e-6)
    assert np.all(np.isnan(means[~reached]))
