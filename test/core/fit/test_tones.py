"""Sines in residuals: which are found, and which are the model's own."""

import numpy as np
import pytest

from afm_scan_ros.core.fit.settings import FitSettings
from afm_scan_ros.core.fit.tones import find_tones
from afm_scan_ros.core.types import Array

PERIOD = 1e-4
SETTINGS = FitSettings()
SECONDS = PERIOD * np.arange(20_000)
NOISE = np.random.default_rng(0).standard_normal(len(SECONDS))
QUIET = np.zeros(len(SECONDS))


def sine(frequency: float) -> Array:
    return np.asarray(np.sin(2.0 * np.pi * frequency * SECONDS))


def found(residual: Array, motion: Array, drive: Array = QUIET) -> list[float]:
    return find_tones(residual, drive, motion, PERIOD, SETTINGS)


def test_noise_has_no_tone() -> None:
    assert found(NOISE, QUIET) == []


@pytest.mark.parametrize("frequency", [50.02, 153.7, 1007.3])
def test_a_tone_is_found_to_a_fortieth_of_a_bin(frequency: float) -> None:
    (one,) = found(NOISE + sine(frequency), QUIET)
    assert one == pytest.approx(frequency, abs=0.03)


def test_a_line_that_the_motion_has_is_the_models() -> None:
    assert found(NOISE + 0.2 * sine(153.7), 10.0 * sine(153.7)) == []


def test_lines_of_the_drive_that_a_mode_raises_are_no_tones() -> None:
    """They stand out of their neighbours less than hum does, which is on one line."""
    lines = 0.3 + 10.0 * np.arange(1, 60)
    drive = np.sum([sine(line) for line in lines], axis=0)
    mode = np.sum([sine(line) / (1.0 + abs(line - 302.0) / 15.0) for line in lines], axis=0)
    assert found(NOISE + 3.0 * mode, 0.01 * drive, drive) == []
    (one,) = found(NOISE + 0.3 * mode + 3.0 * sine(100.3), 0.01 * drive, drive)
    assert one == pytest.approx(100.3, abs=0.03)


def test_a_line_stronger_than_the_motions_own_is_not_the_models() -> None:
    motion = 0.2 * np.random.default_rng(1).standard_normal(len(SECONDS)) + 0.05 * sine(153.7)
    (one,) = found(NOISE + sine(153.7), motion)
    assert one == pytest.approx(153.7, abs=0.03)
    assert found(NOISE + sine(153.7), 100.0 * motion) == []


@pytest.mark.parametrize("harmonic", [2, 3, 5])
def test_what_hysteresis_makes_of_a_motion_is_no_tone(harmonic: int) -> None:
    assert found(NOISE + 0.2 * sine(harmonic * 40.3), 10.0 * sine(40.3)) == []


def test_hum_beside_a_motion_that_decays_is_found() -> None:
    decaying = 10.0 * (1.0 - SECONDS / SECONDS[-1]) * sine(40.3)
    (one,) = found(NOISE + sine(49.9), decaying)
    assert one == pytest.approx(49.9, abs=0.03)


def test_hum_beside_one_of_many_lines_is_found() -> None:
    """An error of the model is spread over all lines."""
    rng = np.random.default_rng(2)
    motion = sum(sine(5.0 * k + 0.3) * rng.choice([-1.0, 1.0]) for k in range(1, 200))
    (one,) = found(NOISE + 2.0 * sine(60.0), np.asarray(0.3 * motion))
    assert one == pytest.approx(60.0, abs=0.03)
