"""What is left out of a long curve is not seen: laws of the points that are drawn."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from afm_scan_ros.report.picture import Curve
from afm_scan_ros.report.reduction import block_means, block_peaks, extremes, thinned

VALUES = st.floats(-1e6, 1e6, width=32)
CURVES = arrays.arrays(np.float64, st.integers(1, 400), elements=VALUES | st.just(np.nan))


@given(CURVES, st.integers(1, 50))
def test_every_extreme_of_each_stretch_stays(y: np.ndarray, bins: int) -> None:
    kept = extremes(y, bins)
    assert np.all(np.diff(kept) > 0)
    assert (kept[0], kept[-1]) == (0, y.size - 1)
    assert kept.size <= max(2 * bins + 2, 1)
    starts = np.linspace(0, y.size, bins + 1).astype(int)
    for start, end in pairwise(starts):
        known = y[start:end][np.isfinite(y[start:end])]
        if known.size:
            shown = y[kept[(kept >= start) & (kept < end)]]
            assert (np.nanmin(shown), np.nanmax(shown)) == (known.min(), known.max())


@given(CURVES, st.integers(1, 50))
def test_thinned_again_it_keeps_its_peaks(y: np.ndarray, bins: int) -> None:
    """As of a scan that is read block by block."""
    once = thinned(Curve(np.arange(float(y.size)), y), 2 * bins)
    twice = thinned(once, bins)
    known = y[np.isfinite(y)]
    if known.size:
        assert (np.nanmin(twice.y), np.nanmax(twice.y)) == (known.min(), known.max())
    assert np.array_equal(y[twice.x.astype(int)], twice.y, equal_nan=True)


def test_what_is_short_is_drawn_as_it_is() -> None:
    assert np.array_equal(extremes(np.zeros(6), 3), np.arange(6))


@given(st.integers(1, 40), st.integers(1, 40), st.integers(1, 40))
def test_an_image_keeps_its_mean_and_none_of_its_sides_exceeds_the_finest(
    lines: int, pixels: int, finest: int
) -> None:
    values = np.random.default_rng(lines + 100 * pixels).normal(size=(lines, pixels))
    shown = block_means(values, finest)
    assert shown.shape == (min(lines, finest), min(pixels, finest))
    if lines % finest == pixels % finest == 0:
        assert shown.mean() == pytest.approx(values.mean())
    assert shown.min() >= values.min() - 1e-12
    assert shown.max() <= values.max() + 1e-12


@given(st.integers(1, 40), st.integers(1, 40), st.integers(1, 40))
def test_an_image_of_peaks_keeps_its_largest_value(lines: int, pixels: int, finest: int) -> None:
    values = np.random.default_rng(lines + 100 * pixels).normal(size=(lines, pixels))
    shown = block_peaks(values, finest)
    assert shown.shape == (min(lines, finest), min(pixels, finest))
    assert np.isin(shown, values).all()
    assert np.abs(shown).max() == np.abs(values).max()
