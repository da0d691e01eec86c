"""Laws of what elements add to a linear structure."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from afm_scan_ros.core.identification.state_space.elements import (
    LEAST_LEVEL,
    Powers,
    Slips,
    Softening,
    averaged,
    resampled,
)

SAMPLES = 256
ONE = np.eye(2)


def noise(seed: int, lines: int = 100) -> np.ndarray:
    """A period of two channels with lines well below half the sampling rate."""
    rng = np.random.default_rng(seed)
    spectrum = np.zeros((SAMPLES // 2 + 1, 2), dtype=complex)
    spectrum[1:lines] = np.exp(2j * np.pi * rng.random((lines - 1, 2)))
    signal = np.fft.irfft(spectrum, SAMPLES, axis=0)
    return signal / signal.std()


seeds = st.integers(0, 1000)
scales = st.floats(0.1, 10.0)


@given(seed=seeds, scale=scales)
@settings(deadline=None)
def test_slips_scale_with_their_thresholds(seed: int, scale: float) -> None:
    v = noise(seed)
    slips, wider = Slips((0.3, 2.0), ONE), Slips((0.3 * scale, 2.0 * scale), ONE)
    assert_allclose(scale * slips.added(v, v), wider.added(v, scale * v), atol=1e-12 * scale)


@given(seed=seeds)
@settings(deadline=None)
def test_slips_never_exceed_their_threshold_and_stick_below_it(seed: int) -> None:
    v = noise(seed)
    largest = float(np.abs(v).max())
    slips = Slips((0.3, 1.01 * largest), ONE).added(v, v)
    assert np.abs(slips[:, [0, 2]]).max() == pytest.approx(0.3)
    assert_allclose(slips[:, [1, 3]], v, atol=1e-12)


@given(seed=seeds)
@settings(deadline=None)
def test_slips_at_the_input_see_between_the_samples(seed: int) -> None:
    """A drive of few lines is sampled finely already: interpolation changes little."""
    v = noise(seed, lines=6)
    assert_allclose(Slips((0.5,)).added(v, v), Slips((0.5,), ONE).added(v, v), atol=0.1)


@given(seed=seeds)
@settings(deadline=None)
def test_resampling_keeps_the_samples(seed: int) -> None:
    v = noise(seed)
    fine = resampled(v, 4 * SAMPLES)
    assert_allclose(fine[::4], v, atol=1e-12)
    assert_allclose(resampled(fine, SAMPLES), v, atol=1e-12)


@given(seed=seeds, memory=st.floats(1.0, 1000.0))
@settings(deadline=None)
def test_an_average_keeps_the_mean_and_the_bounds(seed: int, memory: float) -> None:
    power = noise(seed) ** 2
    mean = averaged(power, memory)
    assert_allclose(mean.mean(axis=0), power.mean(axis=0))
    assert np.all((mean > power.min(axis=0)) & (mean < power.max(axis=0)))
    kept = np.exp(-1.0 / memory)
    assert_allclose(mean[1:], kept * mean[:-1] + (1.0 - kept) * power[1:], atol=1e-12)
    assert_allclose(averaged(power, np.inf)[0], power.mean(axis=0))


@given(seed=seeds, scale=scales)
@settings(deadline=None)
def test_softening_grows_with_the_logarithm_of_the_level(seed: int, scale: float) -> None:
    v = noise(seed) / noise(seed).std(axis=0)
    added = Softening(ONE, 1.0).added(v, scale * v)
    level = 0.5 * np.log(scale**2 + LEAST_LEVEL**2)
    assert_allclose(added, level * np.hstack([scale * v, v]), atol=1e-9)


def test_powers_are_those_of_the_elongation() -> None:
    assert_allclose(Powers((2, 3), 2.0 * ONE).added(ONE, ONE), [[4, 0, 8, 0], [0, 4, 0, 8]])
