"""A record as the fit takes it: its noise, its blocks, and from where on it counts."""

import numpy as np
import pytest
from scipy import signal

import afm_scan_ros as afm
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.fit.axis import fit_axis
from afm_scan_ros.core.fit.noise import correlation_length, noise_of
from afm_scan_ros.core.fit.signals import (
    known_from,
    longest_block,
    steps_read_after,
)
from afm_scan_ros.core.types import Array
from helpers.fit_cases import (
    GAIN,
    OPERATORS,
    PERIOD,
    SETTINGS,
    displaced,
    levels,
)


def test_noise_is_that_of_third_differences_whatever_moves_slowly() -> None:
    rng = np.random.default_rng(1)
    slow = np.sin(np.linspace(0.0, 20.0, 50_000))
    assert noise_of(slow + 1e-3 * rng.standard_normal(len(slow))) == pytest.approx(1e-3, rel=0.03)


def test_blocks_are_as_long_as_nothing_turns_within_them() -> None:
    rng = np.random.default_rng(1)
    slow = np.sin(np.linspace(0.0, 60.0, 100_000))
    moved = slow + 1e-3 * rng.standard_normal(len(slow))
    long = longest_block(slow, moved, 1e-3, SETTINGS)
    short = longest_block(np.sin(np.linspace(0.0, 600.0, 100_000)), moved, 1e-3, SETTINGS)
    assert long >= 32 > short


@pytest.mark.parametrize("kept", [0.0, 0.5, 0.9])
def test_neighbours_count_once_as_far_as_they_are_alike(kept: float) -> None:
    """Of an autoregression of order one the correlations are a geometric series."""
    noise = np.random.default_rng(3).standard_normal(100_000)
    alike = signal.lfilter([1.0], [1.0, -kept], noise)
    assert correlation_length(alike) == pytest.approx((1.0 + kept) / (1.0 - kept), rel=0.1)


@pytest.mark.parametrize("late", [0, 1])
def test_a_record_of_steps_shows_whether_it_was_read_after_the_update(late: int) -> None:
    drive = np.repeat([0.0, 2.0, 0.5, 1.5], 200)
    noise = 1e-9 * np.random.default_rng(9).standard_normal(len(drive))
    moved = GAIN * np.concatenate([np.zeros(late), drive])[: len(drive)] + noise
    assert steps_read_after(afm.Record(drive, moved, PERIOD), SETTINGS) == (late == 0)


def test_no_other_record_is_taken_for_one_read_after_the_update() -> None:
    """Of a resonance, its first samples follow in any way."""
    drive = levels(3, 10, 300)
    moved = displaced(OPERATORS["plays"], drive)
    assert not steps_read_after(afm.Record(drive, moved, PERIOD), SETTINGS)


def test_memory_is_known_from_rest_or_from_both_ends() -> None:
    path = np.interp(np.arange(2500), 500.0 * np.arange(6), [0.0, 1.0, -2.0, 2.0, -1.0, 2.0])
    assert known_from(path, SETTINGS, depolarised=True) == 0
    assert abs(known_from(path, SETTINGS, depolarised=False) - 1500) < 10


@pytest.mark.parametrize(
    "path",
    [np.linspace(0.0, 1.0, 1000), np.repeat([0.0, 2.0], 500), np.linspace(0.0, 1.0, 2000) ** 2],
)
def test_a_record_whose_memory_is_never_known_counts_all_the_same(path: Array) -> None:
    """Else nothing of it would show the gain."""
    assert known_from(path, SETTINGS, depolarised=False) == 0


def test_a_record_of_few_samples_is_refused_by_name() -> None:
    rise = np.linspace(0.0, 1.0, 150)
    record = afm.Record(rise, GAIN * rise, PERIOD, name="rise")
    with pytest.raises(InputError, match="rise: holds only 150 samples: give a record of 200"):
        fit_axis([record], "x")
