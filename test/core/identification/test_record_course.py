"""A spring that hardens keeps to its course, however coarsely sampled; lost samples leave it."""

import numpy as np
import pytest

from afm_scan_ros.core.identification.records.samples import course_problems
from afm_scan_ros.core.types import Array

SEEDS, COUNT, FINER = 12, 6000, 8
OMEGA, DAMPING, CUBE = 2.0 * np.pi * 1000.0, 0.05, 0.02
"""rad/s, share and 1/µm² of an oscillator that gives 1 µm/V at rest."""
NOISE = 1e-4
"""Of the sensor, in µm for each µm of motion."""


def waves() -> Array:
    """Drives (n, seeds) in V up to 0.3 of the Nyquist frequency, ``FINER`` steps a sample."""
    rng = np.random.default_rng(0)
    spectrum = np.zeros((SEEDS, COUNT * FINER // 2 + 1), complex)
    lines = np.arange(1, int(0.15 * COUNT))
    spectrum[:, lines] = np.exp(2j * np.pi * rng.random((SEEDS, len(lines))))
    drive = np.fft.irfft(spectrum).T
    return np.asarray(drive / drive.std())


def moved(drive: Array, step: float) -> Array:
    """Displacement (n, seeds) in µm by Runge and Kutta's method, in double steps of a drive (V)."""

    def changed(state: Array, force: Array) -> Array:
        x, speed = state
        push = OMEGA**2 * (force - x - CUBE * x**3) - 2.0 * DAMPING * OMEGA * speed
        return np.array([speed, push])

    state, course = np.zeros((2, SEEDS)), np.zeros((len(drive) // 2, SEEDS))
    for k in range(1, len(course)):
        first, middle, last = drive[2 * k - 2 : 2 * k + 1]
        one = changed(state, first)
        two = changed(state + step * one, middle)
        three = changed(state + step * two, middle)
        four = changed(state + 2.0 * step * three, last)
        state = state + step / 3.0 * (one + 2.0 * two + 2.0 * three + four)
        course[k] = state[0]
    return course


@pytest.mark.parametrize("samples", [6, 20])
def test_lost_samples_leave_the_course_of_a_spring_that_hardens(samples: int) -> None:
    """A period of the resonance has ``samples``; the coarser are too few for a loss to be sure."""
    fine = waves()
    course = moved(fine, 1.0 / (1000.0 * samples * FINER))
    drive, seen = fine[::FINER], course[:: FINER // 2]
    seen = seen + NOISE * seen.std() * np.random.default_rng(1).standard_normal(seen.shape)
    for volts, whole in zip(drive.T, 1e-6 * seen.T, strict=True):
        assert not list(course_problems("x", volts, whole))
        lost = np.append(np.delete(whole, slice(3000, 3005)), whole[-5:])
        if samples > 10:
            (problem,) = course_problems("x", volts, lost)
            assert "displacement x" in problem
