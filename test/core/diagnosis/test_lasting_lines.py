"""Lines that last are found at the stated rate of false alarms; a transient is none."""

import numpy as np
import pytest
from scipy.stats import binom

from afm_scan_ros.core.diagnosis.repetition import Repetition
from afm_scan_ros.core.diagnosis.settings import PARTING
from afm_scan_ros.core.diagnosis.tones import lasting_lines, without_tones
from afm_scan_ros.core.types import Array

COUNT, PERIOD = 8192, 1e-4
TIME = PERIOD * np.arange(COUNT)
DRAWS = 200
DETECTED = float(np.sqrt(4.0 * np.log(COUNT / PARTING.false_alarm) / COUNT))
"""Amplitude over the noise's deviation whose line is as high as the noise's may be."""


def noise(seed: int) -> Array:
    return np.random.default_rng(seed).standard_normal(COUNT)


def tone(frequency: float, size: float) -> Array:
    return np.asarray(size * np.sin(2.0 * np.pi * frequency * TIME + 1.0))


def test_noise_alone_shows_a_line_as_rarely_as_stated() -> None:
    alarms = sum(bool(lasting_lines(noise(k), PERIOD, None)) for k in range(DRAWS))
    assert alarms <= binom.isf(1e-3, DRAWS, PARTING.false_alarm)


def test_a_tone_half_as_large_again_as_the_least_is_found() -> None:
    rng = np.random.default_rng(1)
    found = 0
    for k in range(50):
        frequency = float(rng.uniform(100.0, 4900.0))
        lines = lasting_lines(noise(k) + tone(frequency, 1.5 * DETECTED), PERIOD, None)
        found += bool(lines) and abs(lines[0] - frequency) <= 1.0 / (COUNT * PERIOD)
    assert found >= 45


@pytest.mark.parametrize("turns", [6.5, 10.5])
def test_a_line_between_the_first_harmonics_is_found(turns: float) -> None:
    of = Repetition(0, COUNT, 6.0)
    frequency = turns * 6.0 / (COUNT * PERIOD)
    (line, *_) = lasting_lines(noise(4) + tone(frequency, 1.0), PERIOD, of)
    assert abs(line - frequency) <= 1.0 / (COUNT * PERIOD)


def test_a_transient_is_no_line() -> None:
    """It has all of its power in the first half."""
    ringing = tone(700.0, 3.0) * np.exp(-TIME / 0.05)
    assert lasting_lines(noise(1) + ringing, PERIOD, None) == ()


def test_a_line_beside_a_harmonic_is_not_told_from_it() -> None:
    of, rate = Repetition(0, COUNT, 32.0), 32.0 / (COUNT * PERIOD)
    for turns, seen in ((5.5, True), (5.0, False), (5.05, False)):
        lines = lasting_lines(noise(2) + tone(turns * rate, 1.0), PERIOD, of)
        near = [line for line in lines if abs(line / rate - turns) < 0.05]
        assert bool(near) is seen


@pytest.mark.parametrize("size", [0.3, 30.0])
def test_what_is_left_without_tones_is_the_noise(size: float) -> None:
    seen = noise(3) + tone(333.3, size) + tone(1234.5, 0.5 * size)
    left = without_tones(seen, PERIOD, None)
    assert np.std(left - noise(3)) < 0.1


@pytest.mark.parametrize("periods", [20.0, 30.4])
def test_what_is_left_between_harmonics_without_tones_is_the_noise(periods: float) -> None:
    """A tone leaves its share of every harmonic, so that what is between them is no tone."""
    of, rate = Repetition(0, COUNT, periods), periods / (COUNT * PERIOD)
    clear = of.part_between(noise(3))
    hum = np.sum([tone(k * 1.4 * rate, 30.0 / k) for k in (1, 2, 3)], axis=0)
    seen = clear + of.part_between(hum)
    assert np.std(without_tones(seen, PERIOD, of) - clear) < 0.2
