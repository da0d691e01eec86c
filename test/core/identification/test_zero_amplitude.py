"""The response at zero amplitude is that of a scanner without hysteresis."""

import numpy as np
import pytest
from scipy import signal

from afm_scan_ros.core.identification.drives.waveforms import Multisine, whole
from afm_scan_ros.core.identification.vibration.frequency_response import (
    frequency_response,
    response_at_zero_amplitude,
)
from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.axis import PlayBank

PERIOD, SAMPLE_PERIOD = 1000, 1e-4
B, A = [0.0, 0.3, -0.1], [1.0, -0.8, 0.2]
PLAYS = PlayBank(np.linspace(2.5e-4, 0.4, 800), np.full(800, 5e-4), 1.0, 0.0, 0.0)
"""Rayleigh's law at small amplitude, with the gain 1 at rest."""


def drive_at(peaks: list[float]) -> Array:
    rng = np.random.default_rng(1)
    spectrum = np.zeros(PERIOD // 2 + 1, dtype=np.complex128)
    lines = np.arange(2, 100)
    spectrum[lines] = np.exp(2j * np.pi * rng.random(len(lines))) / lines
    wave = np.fft.irfft(spectrum, PERIOD)
    waves = np.outer(peaks, wave / np.abs(wave).max())
    return whole(Multisine(SAMPLE_PERIOD, waves, repeats=5))


def test_straight_line_ends_where_there_is_no_hysteresis() -> None:
    drive = drive_at([0.3, 0.03, 0.02, 0.01])
    output = signal.lfilter(B, A, PLAYS.apply(PLAYS.relaxed(), drive)[1])
    found = response_at_zero_amplitude(drive, output, SAMPLE_PERIOD)
    assert found is not None
    _, true = signal.freqz(B, A, found.omega * SAMPLE_PERIOD)
    error = np.abs(found.response / true - 1.0)
    assert np.median(error) < 1e-3
    last = slice(-5 * PERIOD, None)
    weakest = frequency_response(drive[last], drive[last], output[last], SAMPLE_PERIOD)
    assert np.median(error) < 0.3 * np.median(np.abs(weakest.response / true - 1.0))


def test_distance_from_the_straight_line_is_scatter() -> None:
    drive = drive_at([0.3, 0.03, 0.02, 0.01])
    noise = 1e-5 * np.random.default_rng(2).standard_normal(len(drive))
    found = response_at_zero_amplitude(drive, signal.lfilter(B, A, drive) + noise, SAMPLE_PERIOD)
    assert found is not None
    _, true = signal.freqz(B, A, found.omega * SAMPLE_PERIOD)
    error = np.abs(found.response - true)
    assert np.sqrt(np.mean((error / found.deviation) ** 2)) == pytest.approx(1.0, abs=0.35)


def test_one_amplitude_identifies_nothing_and_neither_does_a_sweep() -> None:
    drive = drive_at([0.3, 0.3])
    assert response_at_zero_amplitude(drive, drive, SAMPLE_PERIOD) is None
    sweep = signal.chirp(np.arange(20_000) * SAMPLE_PERIOD, 5.0, 2.0, 500.0)
    assert response_at_zero_amplitude(sweep, sweep, SAMPLE_PERIOD) is None
