"""Stretches are as long as both signals are smooth, and lose nothing that is seen."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from afm_scan_ros.core.fit.stretches import means, smooth_edges
from afm_scan_ros.core.types import Array
from helpers.fit_cases import SETTINGS

NOISE = 1e-9
TIMES = np.arange(40_000)


def edges_of(drive: Array, moved: Array, first: int = 0, seed: int = 1) -> Array:
    noise = np.random.default_rng(seed).normal(0.0, NOISE, len(drive))
    return smooth_edges(drive, moved + noise, NOISE, 100.0, first, SETTINGS)


@given(st.integers(0, 4000), st.integers(1, 4000), st.integers(0, 2**32 - 1))
def test_stretches_hold_each_sample_once_and_begin_at_the_first_that_counts(
    first: int, more: int, seed: int
) -> None:
    drive = np.random.default_rng(seed).standard_normal(first + more).cumsum()
    edges = smooth_edges(drive, 1e-6 * drive, NOISE, 1.0, first, SETTINGS)
    lengths = np.diff(edges)
    assert (edges[0], edges[-1]) == (0, len(drive))
    assert (lengths > 0).all()
    assert first in edges
    assert np.log2(lengths).round() == pytest.approx(np.log2(lengths))


@pytest.mark.parametrize("period", [16, 100, 1000])
def test_a_sine_above_the_noise_has_at_least_four_stretches_a_period(period: int) -> None:
    wave = np.sin(2.0 * np.pi * TIMES / period)
    for drive, moved in ((0.0 * wave, 5.0 * NOISE * wave), (wave, 0.0 * wave)):
        longest = np.diff(edges_of(drive, moved)).max()
        assert period / 32 < longest <= period / 4


def test_rest_has_stretches_as_long_as_windows_allow() -> None:
    lengths = np.diff(edges_of(np.zeros(40_000), np.full(40_000, 1e-6)))
    assert len(lengths) < 6 * SETTINGS.smooth_window
    assert lengths.max() == 512


def test_stretches_after_a_step_are_no_longer_than_a_part_of_the_time_since() -> None:
    drive = np.where(TIMES < 10_000, 0.0, 1.0)
    creep = np.log1p(np.maximum(TIMES - 10_000, 0) / 10.0)
    edges = edges_of(drive, 1e-6 * drive + 1e-8 * creep)
    begins, lengths = edges[:-1], np.diff(edges)
    later = begins >= 10_000
    longer = later & (lengths > 1)
    assert (lengths[longer] <= (begins[longer] - 10_000) / SETTINGS.smooth_age).all()
    assert lengths[later].max() >= 64
    assert not lengths[(begins > 9_990) & (begins < 10_000)].max() > 1


def test_the_drive_moves_little_within_a_stretch() -> None:
    """The rises of plays are no lines of the drive, however straight that is."""
    drive = np.linspace(-1.0, 1.0, 40_000)
    edges = smooth_edges(drive, 0.0 * drive, NOISE, 1.0, 0, SETTINGS)
    longest = np.diff(drive[np.minimum(edges, len(drive) - 1)]).max()
    assert 0.5 * SETTINGS.smooth_move < longest <= SETTINGS.smooth_move + 1e-4


def test_means_are_those_of_each_stretch() -> None:
    signal, edges = np.random.default_rng(2).standard_normal((20, 3)), np.array([0, 1, 4, 12])
    expected = [signal[0], signal[1:4].mean(axis=0), signal[4:12].mean(axis=0)]
    np.testing.assert_allclose(means(signal, edges), expected)
