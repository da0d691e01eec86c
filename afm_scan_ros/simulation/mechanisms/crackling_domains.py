"""Domains that crackle: their walls run through a ground that pins them here more, there less.

    u_out = u + n(s) - n(0),    s = the way that u has gone,    n = amplitude sqrt(2 / TONES) sum
    cos(k_i s + phase_i),    <n(s) n(s + d)> = amplitude^2 e^(-d / length)

What pins a wall is a random walk along its way, held together by the field of the domain itself
(Alessandro, Beatrice, Bertotti, Montorsi): the piezo sees noise that stands still when the drive
does, runs with it in either direction, and is never twice the same: neither noise of time nor of
place, and no effect of the catalogue. Tones whose wave numbers are drawn from Cauchy's distribution
have that covariance, and many of them are noise (Rice).
Source: B. Alessandro, C. Beatrice, G. Bertotti, A. Montorsi, J. Applied Physics 68 (1990) 2901;
V. M. Rudyak, Soviet Physics Uspekhi 13 (1971) 461 (in ferroelectrics).
"""

from typing import ClassVar

import numpy as np
from attrs import frozen
from attrs.validators import gt

from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.mechanisms.base import Insert, Place
from afm_scan_ros.simulation.quantity import quantity

TONES = 400


@frozen(kw_only=True)
class CracklingDomains(Insert):
    """``amplitude`` (V), rms; ``length`` (V) of the way after which the noise is another.

    State: way gone (V), last u (V) and last sum of the tones, shape (3,), and the tones' wave
    numbers (1/V) and phases (rad), shape (2, TONES).
    """

    KIND: ClassVar[str] = "crackling_domains"
    PLACE: ClassVar[Place] = "drive"

    amplitude: float = quantity(suffix="_mv", scale=1e-3)
    length: float = quantity(gt(0.0), suffix="_v")

    def at_rest(self, step: float, rng: np.random.Generator) -> tuple[Array, Array]:  # noqa: ARG002
        """Never driven, in a ground drawn by chance."""
        numbers = rng.standard_cauchy(TONES) / self.length
        phases = rng.uniform(0.0, 2.0 * np.pi, TONES)
        return np.array([0.0, 0.0, np.cos(phases).sum()]), np.stack((numbers, phases))

    def act(
        self,
        state: tuple[Array, Array],
        own: Array,
        other: Array,  # noqa: ARG002
        step: float,  # noqa: ARG002
    ) -> tuple[tuple[Array, Array], Array]:
        """Drive (V) that the domains follow."""
        moving, tones = state[0].copy(), state[1]
        noise = _crackle(moving, own, tones) - np.cos(tones[1]).sum()
        return (moving, tones), own + self.amplitude * np.sqrt(2.0 / TONES) * noise


@compiled
def _crackle(moving: Array, drive: Array, tones: Array) -> Array:
    way, last, total = moving
    noise = np.empty_like(drive)
    for k in range(drive.size):
        if drive[k] != last:
            way, last, total = way + abs(drive[k] - last), drive[k], 0.0
            for i in range(tones.shape[1]):
                total += np.cos(tones[0, i] * way + tones[1, i])
        noise[k] = total
    moving[:] = way, last, total
    return noise
