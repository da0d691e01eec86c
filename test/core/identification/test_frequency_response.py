"""The response of a known sampled system is recovered line by line."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import signal

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.drives.waveforms import Multisine, whole
from afm_scan_ros.core.identification.vibration.frequency_response import frequency_response
from afm_scan_ros.core.identification.vibration.spectra import repetition
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


def test_noise_is_distinguished_from_what_the_input_does_not_explain() -> None:
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


def out_of_step() -> Array:
    rng = np.random.default_rng(0)
    time = np.arange(8000) / 1000.37
    lines = np.arange(1, 40)
    phases = 2.0 * np.pi * rng.random(len(lines))
    return np.asarray(np.sum(np.cos(2.0 * np.pi * np.outer(time, lines) + phases), axis=1))


NOISE = np.random.default_rng(0).standard_normal(20_000)


@pytest.mark.parametrize(
    "drive",
    [NOISE, np.repeat(NOISE[:200], 100)],
    ids=["noise", "steps"],
)
def test_any_drive_shows_the_response(drive: Array) -> None:
    noise = 1e-4 * np.random.default_rng(1).standard_normal(len(drive))
    output = signal.lfilter(B, A, drive) + noise
    found = frequency_response(drive, drive, output, 1.0 / RATE).seen()
    _, true = signal.freqz(B, A, found.omega / RATE)
    error = np.abs(found.response - true)
    assert len(error) > 10
    assert np.sqrt(np.mean((error / found.deviation) ** 2)) == pytest.approx(1.0, abs=0.3)


def test_waves_out_of_step_with_the_sampling_are_named() -> None:
    drive = out_of_step()
    with pytest.raises(InputError, match="not synchronised with the sampling"):
        frequency_response(drive, drive, drive, 1e-4)


def test_the_axis_driven_second_rests_first() -> None:
    for before, after in ((0, 9137), (9137, 0)):
        drive = np.concatenate([np.zeros(before), drive_of(PERIOD, 3), np.zeros(after)])
        found = frequency_response(drive, drive, signal.lfilter(B, A, drive), 1.0 / RATE)
        _, true = signal.freqz(B, A, found.omega / RATE)
        np.testing.assert_allclose(found.response, true, rtol=0.0, atol=1e-6)


def test_of_several_amplitudes_the_largest_counts() -> None:
    strong, weak = drive_of(PERIOD, 3), drive_of(PERIOD, 4)
    drive = np.concatenate([strong, 0.1 * weak])
    bent = np.concatenate([signal.lfilter(B, A, strong), 5.0 * weak])
    found = frequency_response(drive, drive, bent, 1.0 / RATE)
    _, true = signal.freqz(B, A, found.omega / RATE)
    np.testing.assert_allclose(found.response, true, rtol=0.0, atol=1e-9)
