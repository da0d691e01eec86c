"""Mechanisms of sensor_gain.py, each against the solution of its equation."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from afm_scan_bench.mechanisms.sensor_gain import (
    BurstingSupply,
    FlickeringReference,
    SaturatingSensor,
)
from helpers.acting import act


def test_a_gauge_flattens_about_its_middle() -> None:
    gauge = SaturatingSensor(axis="x", reach=50e-6, offset=5e-6)
    x = np.linspace(-20e-6, 30e-6, 1001)
    read = act(gauge, x)
    slope = np.gradient(read, x)
    assert x[slope.argmax()] == pytest.approx(5e-6, abs=1e-7)
    assert np.interp(0.0, x, read) == pytest.approx(0.0, abs=1e-12)
    assert np.interp(0.0, x, slope) == pytest.approx(1.0, rel=1e-4)
    np.testing.assert_allclose(slope, 1.01 / (1.0 + ((x - 5e-6) / 50e-6) ** 2), rtol=1e-3)


def test_a_reference_flickers_alike_in_every_octave_and_not_at_zero() -> None:
    flickering, count = FlickeringReference(axis="x", amplitude=0.01), 8000
    gains = [act(flickering, np.ones(count), seed=seed, step=1.0 / count) for seed in range(20)]
    power = 2.0 * np.mean(np.abs(np.fft.rfft(gains)) ** 2, axis=0) / count**2  # 1 Hz apart
    assert power[1:].sum() == pytest.approx(1e-4, rel=0.15)
    octaves = [power[low : 2 * low].sum() for low in (10, 40, 160, 640)]
    expected = 1e-4 * np.log(2.0) / np.log(2000.0 / 0.5)
    np.testing.assert_allclose(octaves, expected, rtol=0.4)  # 100 tones or so, by chance
    assert not act(flickering, np.zeros(100)).any()


@settings(deadline=None, max_examples=20)
@given(seed=st.integers(0, 10_000), sag=st.floats(1e-3, 1.0))
def test_an_excitation_sags_between_bursts_about_the_same_mean(seed: int, sag: float) -> None:
    supply, count = BurstingSupply(axis="x", sag=sag, bursts=100.0), 10_000
    gain = act(supply, np.ones(5 * count), step=0.01 / count, seed=seed)
    assert gain.mean() == pytest.approx(1.0, abs=sag / count)
    steps = np.diff(np.log(gain))
    bursts = np.flatnonzero(steps > 0.0)
    np.testing.assert_array_equal(np.diff(bursts), count)
    np.testing.assert_allclose(steps[bursts], sag * (1.0 - 1.0 / count), rtol=1e-6)
    np.testing.assert_allclose(np.delete(steps, bursts), -sag / count, rtol=1e-6)
    assert not act(supply, np.zeros(10)).any()
