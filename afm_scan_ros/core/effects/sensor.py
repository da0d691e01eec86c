"""The measuring chain: what is read of the displacement, when, and no part of the motion.

A Butterworth filter of an even order n and a corner ω_c has poles on a circle of that radius,

    M(s) = e^{-sτ} Π_k 1 / (1 - s / p_k),    p_k = ω_c exp(jπ/2 + jπ (2k - 1) / (2n)),    k = 1 … n,

and the delay τ is that of converters and buffers, whether before the stage or behind its sensor.

It is part of what a model predicts a sensor to read, and is never inverted. Source: S. Butterworth,
Experimental Wireless and the Wireless Engineer 7 (1930) 536.
"""

import numpy as np
from attrs import field, frozen
from attrs.converters import optional
from numpy.typing import NDArray

from afm_scan_ros.core.effects.vibration import VibrationModel
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import Array


@frozen
class SensorModel:
    """A low-pass of an even ``order`` and a ``corner`` (Hz), and a ``delay`` (s).

    An order of zero is none, without a corner. The displacement is read just before the drive's
    updates, or where it ``reads_after`` them, at the end of the time for which each voltage is
    held. Raises InputError where the order is odd or negative, the corner not positive, or the
    delay negative.
    """

    order: int = field(default=0, converter=int)
    corner: float | None = field(default=None, converter=optional(float))
    delay: float = field(default=0.0, converter=float)
    reads_after: bool = False

    def __attrs_post_init__(self) -> None:
        none, corner = self.order == 0 and self.corner is None, self.corner or 0.0
        if not none and (self.order < 2 or self.order % 2 or not 0.0 < corner < np.inf):  # noqa: PLR2004 - a pair
            raise InputError(
                f"the sensor's low-pass has order {self.order} and corner {corner:g} Hz: give"
                " an even order and a positive corner"
            )
        if not 0.0 <= self.delay < np.inf:
            raise InputError(f"the sensor's delay is {self.delay:g} s: give one of zero or more")

    def __str__(self) -> str:
        """Its low-pass and its delay, as far as it has them."""
        parts = []
        if self.corner is not None:
            parts.append(f"a low-pass of order {self.order} at {self.corner:.4g} Hz")
        if self.delay:
            parts.append(f"a delay of {self.delay:.4g} s")
        if self.reads_after:
            parts.append("readings after the drive's updates")
        return " and ".join(parts)

    @property
    def poles(self) -> NDArray[np.complex128]:
        """Poles above the real axis (rad/s), shape (order / 2,)."""
        turns = 0.5 + (2.0 * np.arange(1, self.order // 2 + 1) - 1.0) / (2.0 * self.order)
        return np.asarray(2.0 * np.pi * (self.corner or 0.0) * np.exp(1j * np.pi * turns))

    @property
    def weights(self) -> NDArray[np.complex128]:
        """Weights κ of these poles, with M(s) = Σ Re κ / (1 - s / p), same shape."""
        every = np.concatenate([self.poles, self.poles.conj()])
        others = [np.delete(every, k) for k in range(len(self.poles))]
        each = [1.0 / np.prod(1.0 - p / o) for p, o in zip(self.poles, others, strict=True)]
        return np.asarray(2.0 * np.array(each, complex), np.complex128)

    def read(self, vibration: VibrationModel) -> VibrationModel:
        """Return a vibration as it is read by the sensor."""
        poles = np.concatenate([self.poles, self.poles.conj()])
        low_pass = np.poly(poles).real / np.prod(-poles).real
        denominator = np.polymul(vibration.denominator, low_pass)
        delay = vibration.delay + self.delay
        return VibrationModel(vibration.numerator, tuple(denominator), delay)


def led(drive: Array) -> Array:
    """Return a drive (V), (n, ...), a sample ahead, for readings that follow its updates."""
    return np.concatenate([drive[1:], drive[-1:]])
