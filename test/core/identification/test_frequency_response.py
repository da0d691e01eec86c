"""The response of a known sampled system is recovered line by line."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import signal

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.drives.multisine import Multisine
from afm_scan_ros.core.identification.drives.waypoints import whole
from afm_scan_ros.core.identification.vibration.frequency_response import frequency_response
from afm_scan_ros.core.identification.vibration.periodic import repetition
from afm_scan_ros.core.types import Array

PERIOD, RATE = 1000, 10_000.0
B, A = [0.0, 0.3, -0.1], [1.0, -0.8, 0.2]


def drive_of(period: int, seed: int, waves: int = 3) -> Array:
    rng = np.random.default_rng(seed)
    spectrum = np.zeros((waves, period // 2 + 1), dtype=np.complex128)
    lines = np.arange(2, period // 4)
    spectrum[:, lines] = np.exp(2j * np.pi * rng.random((waves, len(lines)))) / lines
    return whole(Multisine(1.0 / RATE, period * np.fft.irfft(spectrum, period), 6))


def test_response_is_that_of_the_filter() -> None:
    drive = drive_of(PERIOD, 3)
    output = signal.lfilter(B, A, drive)
    found = frequency_response(drive, drive, output, 1.0 / RATE)
    _, true = signal.freqz(B, A, found.omega / RATE)
    assert len(found.omega) == PERIOD // 4 - 2
    np.testing.assert_allclose(found.response, true, rtol=0.0, atol=1e-9)


def test_noise_is_told_from_what_the_input_does_not_explain() -> None:
    drive = drive_of(PERIOD, 3)
    rng = np.random.default_rng(1)
    clean = signal.lfilter(B, A, drive)
    noisy = frequency_response(drive, drive, clean + 1e-3 * rng.standard_normal(len(drive)), 1e-4)
    bent = frequency_response(drive, drive, clean + 1e-2 * drive**3, 1e-4)
    assert np.median(noisy.scatter / noisy.noise) == pytest.approx(1.0, abs=0.5)
    assert np.median(bent.scatter) > 100.0 * np.median(bent.noise)


@settings(max_examples=25, deadline=None)
@given(period=st.integers(100, 900), seed=st.integers(0, 99))
def test_period_is_read_from_the_drive(period: int, seed: int) -> None:
    assert repetition(drive_of(period, seed)[:, np.newaxis]) == period


def test_drive_that_does_not_repeat_is_refused() -> None:
    drive = np.random.default_rng(0).standard_normal(5000)
    with pytest.raises(InputError, match="never three times the same"):
        frequency_response(drive, drive, drive, 1e-4)


def test_drive_out_of_step_with_the_sampling_is_named() -> None:
    rng = np.random.default_rng(0)
    time = np.arange(8000) / 1000.37
    lines = np.arange(1, 40)
    phases = 2.0 * np.pi * rng.random(len(lines))
    drive = np.sum(np.cos(2.0 * np.pi * np.outer(time, lines) + phases), axis=1)
    with pytest.raises(InputError, match="not synchronised with the sampling"):
        frequency_response(drive, drive, drive, 1e-4)


def test_of_several_amplitudes_the_largest_counts() -> None:
    strong, weak = drive_of(PERIOD, 3), drive_of(PERIOD, 4)
    drive = np.concatenate([strong, 0.1 * weak])
    bent = np.concatenate([signal.lfilter(B, A, strong), 5.0 * weak])
    found = frequency_response(drive, drive, bent, 1.0 / RATE)
    _, true = signal.freqz(B, A, found.omega / RATE)
    np.testing.assert_allclose(found.response, true, rtol=0.0, atol=1e-9)
