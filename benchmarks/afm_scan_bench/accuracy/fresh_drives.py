"""Fresh drives for hysteresis: loops, minor loops and several frequencies at once."""

from collections.abc import Callable

import numpy as np

from afm_scan_ros.core.identification.drives.waveforms import waypoints
from afm_scan_ros.core.types import Array

SAMPLE_RATE = 20e3
SPEED = 10.0  # V/s, as slow as the record that was fitted
BLEND = 0.02  # s
REVERSALS = 60
LIMIT = 3.8  # V, within the identified ±4 V
DURATION = 10.0  # s of a sum of sinusoids
FADE = 0.5  # s over which it begins and ends


def loops(rng: np.random.Generator) -> Array:
    """Slow moves between random levels that shrink and grow again."""
    envelope = LIMIT * (0.55 + 0.45 * np.cos(np.linspace(0.0, 4.0 * np.pi, REVERSALS)))
    return _moves(envelope * rng.uniform(-1.0, 1.0, REVERSALS))


def minor_loops(rng: np.random.Generator) -> Array:
    """Slow loops of 0.1 to 2 V, each twice, hanging anywhere in the range."""
    ends = rng.uniform(-LIMIT, LIMIT, REVERSALS // 4)
    across = np.copysign(rng.uniform(0.1, 2.0, len(ends)), -ends)
    return _moves(np.column_stack([ends, ends + across, ends, ends + across]).ravel())


def sinusoids(*hertz: float) -> Callable[[np.random.Generator], Array]:
    """Sum of sinusoids of unlike amplitudes and random phases, its size swelling twice."""

    def drive(rng: np.random.Generator) -> Array:
        time = np.arange(round(DURATION * SAMPLE_RATE)) / SAMPLE_RATE
        amplitudes = rng.uniform(0.2, 1.0, (len(hertz), 1))
        phases = rng.uniform(0.0, 2.0 * np.pi, (len(hertz), 1))
        turns = 2.0 * np.pi * np.outer(hertz, time)
        total = (amplitudes * np.sin(turns + phases)).sum(axis=0)
        swell = 0.6 - 0.4 * np.cos(4.0 * np.pi * time / DURATION)
        edge = np.clip(np.minimum(time, time[-1] - time) / FADE, 0.0, 1.0)
        total *= swell * (1.0 - np.cos(np.pi * edge))
        return np.asarray(LIMIT * total / np.abs(total).max())

    return drive


FRESH: dict[str, Callable[[np.random.Generator], Array]] = {
    "loops of all sizes": loops,
    "minor loops": minor_loops,
    "0.5, 1.3, 2.9, 5 Hz": sinusoids(0.5, 1.3, 2.9, 5.0),
    "1.1, 3.7, 8.3, 20 Hz": sinusoids(1.1, 3.7, 8.3, 20.0),
    "0.7, 13 Hz": sinusoids(0.7, 13.0),
}
"""Drives (V) at SAMPLE_RATE from rest back to rest, by kind."""


def _moves(levels: Array) -> Array:
    path = np.concatenate([[0.0], levels, [0.0]])
    seconds = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(path)) / SPEED + BLEND)])
    samples = np.rint(seconds * SAMPLE_RATE)
    return waypoints(path, samples, BLEND * SAMPLE_RATE)
