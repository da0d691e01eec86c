"""A swept sine, chirped or stepped: how it is recognised, and whether hysteresis distorts it."""

import numpy as np
from scipy.signal import hilbert

from afm_scan_ros.core.identification.vibration.local_response import LocalResponse
from afm_scan_ros.core.types import Array

SINGLE = 0.1
"""Share of its frequency by which a sweep's envelope changes, at most."""
BESIDE = (2.5, 3.5)
"""Multiples of the frequency at which hysteresis has no harmonic: the rest of the residual."""
CYCLES = 10
"""Cycles of the sweep over which harmonics are compared."""
NINTH = 1.0 / 9.0
"""Harmonics are compared below this share of the band: the third still lies low in it."""


def is_sweep(drive: Array) -> bool:
    """Whether a drive, (n,), is a single sine at a time, its envelope slow beside it."""
    analytic = hilbert(drive - drive.mean())
    envelope = np.abs(analytic)
    turning = np.abs(np.diff(analytic))
    return bool(np.abs(np.diff(envelope)).sum() < SINGLE * turning.sum())


def distortion(drive: Array, output: Array, found: LocalResponse) -> float:
    """Third harmonic of the residual of a sweep, over the output's fundamental.

    ``drive`` (V) and ``output`` are those of ``found``, (n,). It is hysteresis that the input does
    not hold.
    """
    phase = np.unwrap(np.angle(hilbert(drive - drive.mean())))
    starts = np.flatnonzero(np.diff(phase // (2.0 * np.pi * CYCLES), prepend=0.0) > 0.0)
    slow = np.diff(starts) > CYCLES * len(drive) / (NINTH * found.cycles)
    third, below, above, fundamental = (
        np.abs(np.add.reduceat(signal * np.exp(-1j * harmonic * phase), starts))[:-1][slow]
        for signal, harmonic in (
            (found.residual, 3),
            *((found.residual, h) for h in BESIDE),
            (output, 1),
        )
    )
    beyond = np.maximum(third**2 - np.maximum(below, above) ** 2, 0.0) ** 0.5
    return float(np.median(beyond / fundamental)) if slow.any() else 0.0
