"""A drive that a monitor read loses its noise, and one that a converter was given stays."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from afm_scan_ros.core.fit.noise import turns_of, white_noise_of, without_noise
from afm_scan_ros.core.types import Array
from helpers.fit_cases import LIMIT, SETTINGS

SEEDS = st.integers(0, 10_000)


def ramps(seed: int, count: int = 30, samples: int = 200) -> Array:
    """Random levels joined by ramps, V, of which each turns."""
    rng = np.random.default_rng(seed)
    sizes = rng.uniform(0.2, 1.0, count) * LIMIT * (-1.0) ** np.arange(count)
    return np.interp(np.arange(samples * (count - 1)) / samples, np.arange(count), sizes)


def multisine(seed: int, highest: float) -> Array:
    """Lines up to a share of the Nyquist frequency, V."""
    rng, lines = np.random.default_rng(seed), np.zeros(2049, complex)
    used = np.arange(1, round(highest * 2048))
    lines[used] = np.exp(2j * np.pi * rng.random(len(used)))
    wave = np.fft.irfft(lines)
    return np.tile(wave / np.abs(wave).max(), 4)


@given(SEEDS, st.floats(1e-5, 5e-4))
def test_the_noise_of_a_measured_drive_is_found(seed: int, share: float) -> None:
    drive, sigma = ramps(seed), share * LIMIT
    noise = sigma * np.random.default_rng(seed + 1).standard_normal(len(drive))
    found = white_noise_of(drive + noise, SETTINGS)
    assert found == pytest.approx(sigma, rel=0.5)  # a third of the windows hold a turn


@pytest.mark.evidence
@given(SEEDS, st.floats(0.05, 0.7))
def test_what_a_converter_was_given_stays(seed: int, highest: float) -> None:
    for drive in (ramps(seed), multisine(seed, highest), np.repeat(ramps(seed)[::200], 300)):
        assert without_noise(drive, LIMIT, SETTINGS) is drive


@given(SEEDS, st.floats(1e-5, 5e-4))
def test_a_measured_drive_turns_where_the_true_one_does(seed: int, share: float) -> None:
    drive, sigma = ramps(seed), share * LIMIT
    noise = sigma * np.random.default_rng(seed + 1).standard_normal(len(drive))
    found = without_noise(drive + noise, LIMIT, SETTINGS)
    true, turns = (turns_of(one, SETTINGS.drive_turn * sigma) for one in (drive, found))
    assert len(turns) == len(true)
    assert np.abs(turns - true).max() <= 1 + 20 * sigma / np.abs(np.diff(drive)).min()
    assert len(turns_of(found, 1e-9 * LIMIT)) == len(true)  # and nowhere else
    assert np.abs(found - drive).max() < 6.0 * sigma  # of 5800 samples
