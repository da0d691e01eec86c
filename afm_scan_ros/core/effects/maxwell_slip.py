"""Maxwell slip: hysteresis of each actuator, of its drive and of its elongation.

To a coupled structure are added w = v - p_i(v): each elasto-slip element follows v up to its
threshold r_i and slips there, p_i being the play of that threshold. The signal v is the drive u of
an actuator, between the samples too, and then its elongation z. That is the drive that would hold
the outputs where they are, at rest. Both are over their rms in the records of the identification,
so thresholds have no unit. Cause: domains that switch with field and stress. Assumption: rate
changes nothing.
"""

import numpy as np
from attrs import frozen

from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.effects.effect_type import (
    Actuators,
    EffectParameter,
    EffectType,
    FeedbackForm,
    register,
)
from afm_scan_ros.core.types import Array, floats

OVERSAMPLING = 4
"""Between the samples the drive is what its lines below half the sampling rate make it."""
PERIODS = 2
"""Until a play under a periodic signal is steady: one to forget, one to keep."""
ELEMENTS = 4
LEAST, LARGEST = 0.12, 2.0
"""Of the records' rms: thresholds from well within the motion to about its peaks."""


@frozen
class DriveSlips:
    """Elasto-slip elements of ``thresholds`` on each drive, over its scale."""

    actuators: Actuators
    thresholds: tuple[float, ...]

    def added(self, drive: Array, output: Array, run: int) -> Array:  # noqa: ARG002 - feedback's
        """Return v - p: (n, m * thresholds)."""
        count = len(drive)
        fine = resampled(self.actuators.scaled(drive), OVERSAMPLING * count)
        slipped = slips(fine, self.thresholds, OVERSAMPLING * run)
        return resampled(slipped, count)


@frozen
class ElongationSlips:
    """Elasto-slip elements of ``thresholds`` on each elongation, at the samples."""

    actuators: Actuators
    thresholds: tuple[float, ...]

    def added(self, drive: Array, output: Array, run: int) -> Array:  # noqa: ARG002 - feedback's
        """Return v - p: (n, m * thresholds)."""
        return slips(self.actuators.elongations(output), self.thresholds, run)


def slips(signal: Array, thresholds: tuple[float, ...], run: int) -> Array:
    """Return v - p, (n, channels * thresholds): of a steady period, or of a ``run`` from rest."""
    periods = PERIODS if run == len(signal) else 1
    slipped = _slips(np.ascontiguousarray(signal[:run]), np.array(thresholds), periods)
    return np.pad(slipped, ((0, len(signal) - run), (0, 0)))


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


PARAMETERS = tuple(EffectParameter(f"threshold_{i + 1}", "1", 1e-3, 1e3) for i in range(ELEMENTS))


def values(_: Actuators) -> tuple[float, ...]:
    """Thresholds, evenly apart in their logarithm."""
    return floats(np.geomspace(LEAST, LARGEST, ELEMENTS))


def elements(
    actuators: Actuators, thresholds: tuple[float, ...]
) -> tuple[DriveSlips, ElongationSlips]:
    """Return the effect's elements for its thresholds."""
    return DriveSlips(actuators, thresholds), ElongationSlips(actuators, thresholds)


@register
def maxwell_slip() -> EffectType:
    """Describe the effect."""
    return EffectType(
        name="maxwell_slip",
        equation="w = v - play of v with threshold_i, for v = u and v = z, added to the inputs of a"
        " coupled structure",
        needs="steady periods of several realisations, better at several amplitudes",
        experiment="amplitudes",
        remedy="feedforward",
        advice="the thresholds span the amplitudes that were identified: stay within them",
        source="M. Goldfarb and N. Celanovic, J. Dyn. Sys. Meas. Control 119 (1997) 478.",
        inverse="The slips of the elongations follow from the target. Those of the drives are"
        " inverted with the structure, in turn until nothing changes.",
        feedback=FeedbackForm(PARAMETERS, values, elements),
    )
