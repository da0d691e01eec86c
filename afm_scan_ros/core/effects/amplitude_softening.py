"""Softening with amplitude: each actuator is softer and gains more, the larger it moves.

To a coupled structure are added w = z ln(a) and u ln(a), of each actuator. Its drive is u and its
elongation z: the drive that would hold the outputs where they are, at rest. Both are over their rms
in the records of the identification, so they have no unit. There are two levels a: the rms of z
over the run, and the rms of z in an average of first order over the `memory` (s) before. Cause:
domain walls and joints that creep into motion, so that stiffness falls and strain per volt grows
with the logarithm of the amplitude. Assumption: the lasting level has settled; the effect does not
state how it does.
"""

import numpy as np
from attrs import frozen

from afm_scan_ros.core.effects.effect_type import (
    Actuators,
    EffectParameter,
    EffectType,
    FeedbackForm,
    register,
)
from afm_scan_ros.core.types import Array

LEAST_LEVEL = 0.01
"""Level at rest, where the logarithm of none would be infinite; of the records' rms."""
MEMORY = EffectParameter("memory", "s", 1e-9, 1e6)


@frozen
class Softening:
    """Compliance and gain that grow with the logarithm of the level of ``memory`` samples."""

    actuators: Actuators
    memory: float = np.inf

    def added(self, drive: Array, output: Array, run: int) -> Array:
        """Return z ln(a), then u ln(a): (n, 2 m)."""
        z = self.actuators.elongations(output)
        power = averaged(z**2, self.memory, run)
        level = 0.5 * np.log(np.maximum(power, 0.0) + LEAST_LEVEL**2)
        return np.hstack([level * z, level * self.actuators.scaled(drive)])


def averaged(power: Array, memory: float, run: int) -> Array:
    """First-order average of a power (n, channels) over ``memory`` samples, or over the ``run``."""
    if np.isinf(memory):
        return np.broadcast_to(power[:run].mean(axis=0), power.shape)
    kept = np.exp(-1.0 / memory)
    delay = np.exp(-2j * np.pi * np.fft.rfftfreq(len(power)))[:, np.newaxis]
    spectrum = np.fft.rfft(power, axis=0) * (1.0 - kept) / (1.0 - kept * delay)
    return np.fft.irfft(spectrum, len(power), axis=0)


def values(actuators: Actuators) -> tuple[float]:
    """Memory as long as the structure's vibrations last."""
    return (MEMORY.nearest(actuators.decay_time),)


def elements(actuators: Actuators, parameters: tuple[float, ...]) -> tuple[Softening, Softening]:
    """Return the element of the lasting level, then that of the level of the memory (s)."""
    (memory,) = parameters
    return Softening(actuators), Softening(actuators, memory / actuators.sample_period)


@register
def amplitude_softening() -> EffectType:
    """Describe the effect."""
    return EffectType(
        name="amplitude_softening",
        equation="w = z ln(a), u ln(a) with a the rms of z over the run, and over memory, added to"
        " the inputs of a coupled structure",
        needs="steady periods at amplitudes that differ by a factor of two or more",
        experiment="amplitudes",
        remedy="feedforward",
        advice="the inverse knows the amplitudes that were identified",
        source="The recordings of M. Floren et al., ISMA-USD 2024, pp. 2042-2052, show it; the"
        " logarithm is this package's.",
        inverse="The levels follow from the target. What they add is inverted with the structure,"
        " in turn until nothing changes.",
        confusable=("maxwell_slip",),
        feedback=FeedbackForm((MEMORY,), values, elements),
    )
