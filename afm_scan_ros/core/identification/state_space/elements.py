"""What a linear structure lacks, as inputs added to it: each computed from drive and output.

The structure's response to an added input is identified with the rest, so an element states only
the shape of an effect and not its size. Elements act on periods in steady state. Of q actuators the
``elongation`` matrix (q, outputs) gives the elongations z (samples, q) from the outputs, in the
drive's unit: the drive that would hold the outputs where they are, at rest.
"""

from typing import Protocol

import numpy as np
from attrs import frozen

from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.types import Array

OVERSAMPLING = 4
"""Between the samples the drive is what its lines below half the sampling rate make it."""
LEAST_LEVEL = 0.01
"""Level at rest, where the logarithm of none would be infinite; of the reference."""
PERIODS = 2
"""Periods until a play under a periodic signal is steady: one to forget, one to keep."""


class FeedbackElement(Protocol):
    """An effect that adds inputs to a linear structure."""

    def added(self, drive: Array, output: Array) -> Array:
        """Inputs (samples, added) of a period of drive (samples, q) and output (samples, p)."""
        ...


@frozen(eq=False)
class Softening:
    """Compliance and gain of each actuator that grow with the logarithm of its level.

    Added are z ln(level) and u ln(level), with level the rms of z over ``reference``, averaged by
    a first-order memory of ``memory`` samples, or over the whole period if that is infinite.
    """

    elongation: Array
    reference: float
    memory: float = np.inf

    def added(self, drive: Array, output: Array) -> Array:
        """Return z ln(level), then u ln(level): (samples, 2 q)."""
        z = output @ self.elongation.T
        level = 0.5 * np.log(averaged(z**2, self.memory) / self.reference**2 + LEAST_LEVEL**2)
        return np.hstack([level * z, level * drive])


@frozen(eq=False)
class Slips:
    """Maxwell's elasto-slip elements: each follows its signal up to a threshold and slips there.

    Added is e = v - p with play p of v, for each ``thresholds`` and channel. The signal v is the
    drive, interpolated; with ``elongation`` it is z, at the samples.
    """

    thresholds: tuple[float, ...]
    elongation: Array | None = None

    def added(self, drive: Array, output: Array) -> Array:
        """Return e: (samples, channels * thresholds)."""
        thresholds = np.array(self.thresholds)
        if self.elongation is not None:
            return _slips(np.ascontiguousarray(output @ self.elongation.T), thresholds, PERIODS)
        fine = _slips(resampled(drive, OVERSAMPLING * len(drive)), thresholds, PERIODS)
        return resampled(fine, len(drive))


@frozen(eq=False)
class Powers:
    """Stiffness without memory: powers of each elongation in volts."""

    exponents: tuple[int, ...]
    elongation: Array

    def added(self, drive: Array, output: Array) -> Array:
        """Return the powers: (samples, q * exponents)."""
        z = output @ self.elongation.T
        return np.hstack([np.zeros((len(drive), 0)), *(z**k for k in self.exponents)])


def averaged(signal: Array, memory: float) -> Array:
    """First-order average of a periodic signal (samples, channels) over ``memory`` samples."""
    if np.isinf(memory):
        return np.broadcast_to(signal.mean(axis=0), signal.shape)
    kept = np.exp(-1.0 / memory)
    delay = np.exp(-2j * np.pi * np.fft.rfftfreq(len(signal)))[:, np.newaxis]
    spectrum = np.fft.rfft(signal, axis=0) * (1.0 - kept) / (1.0 - kept * delay)
    return np.fft.irfft(spectrum, len(signal), axis=0)


def resampled(signal: Array, samples: int) -> Array:
    """Periodic signal (n, channels) at ``samples`` instants, no line above either half rate."""
    spectrum = np.fft.rfft(signal, axis=0)[: (min(samples, len(signal)) + 1) // 2]
    return np.fft.irfft(spectrum, samples, axis=0) * (samples / len(signal))


@compiled
def _slips(signal: Array, thresholds: Array, periods: int) -> Array:
    samples, channels = signal.shape
    count = thresholds.size
    slip = np.empty((samples, channels * count))
    for c in range(channels):
        for i in range(count):
            play = 0.0
            for k in range(periods * samples):
                v = signal[k % samples, c]
                play = min(max(play, v - thresholds[i]), v + thresholds[i])
                slip[k % samples, c * count + i] = v - play
    return slip
