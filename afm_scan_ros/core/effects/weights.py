"""Weights of the optimal inverse: at each frequency, how much an input costs against an error."""

from collections.abc import Callable
from typing import Protocol

import numpy as np
from attrs import field, frozen
from attrs.validators import ge, gt

from afm_scan_ros.core.types import Array


class Weight(Protocol):
    """R/Q of Croft, Shed and Devasia (2001), Eq. 21, in units of |G(0)|²."""

    def ratio(self, omega: Array, sample_period: float) -> Array:
        """R/Q at the angular frequencies ``omega`` (rad/s, up to π/T), same shape."""
        ...


@frozen
class SmoothWeight:
    """R/Q = (ω̃ / 2π corner)^(2 order) with ω̃ = (2/T) sin(ωT/2); ``corner`` in Hz.

    Zero at ω = 0, so a scanner at rest is placed exactly. Rational in ω² for continuous time and
    in z for the sampled system, so the inverse's response dies out exponentially both ways and a
    finite preview suffices.
    """

    corner: float = field(converter=float, validator=gt(0.0))
    order: int = field(validator=ge(1))

    def ratio(self, omega: Array, sample_period: float) -> Array:
        """R/Q at the angular frequencies ``omega``."""
        sampled = 2.0 / sample_period * np.sin(0.5 * omega * sample_period)
        result: Array = (sampled / (2.0 * np.pi * self.corner)) ** (2 * self.order)
        return result


@frozen(eq=False)
class MultipliedWeight:
    """R/Q times ``squared``, |m|² at angular frequencies (rad/s), of a system m G.

    Its optimal inverse is that of G and then 1/m, exactly: the modified trajectory stays the one
    that R/Q was chosen for. So does what G lacks and m multiplies too, m ΔG U = ΔG U_G.
    """

    weight: Weight
    squared: Callable[[Array], Array]

    def ratio(self, omega: Array, sample_period: float) -> Array:
        """R/Q at the angular frequencies ``omega``."""
        return self.weight.ratio(omega, sample_period) * self.squared(omega)


@frozen
class BrickWallWeight:
    """R = 0 up to ``corner`` (Hz) and Q = 0 above, the paper's extreme cases side by side.

    The inverse's response then falls off only as 1/t, so no preview is long enough.
    """

    corner: float = field(converter=float, validator=gt(0.0))

    def ratio(self, omega: Array, sample_period: float) -> Array:  # noqa: ARG002 - the Protocol's
        """R/Q at the angular frequencies ``omega``."""
        return np.where(omega <= 2.0 * np.pi * self.corner, 0.0, np.inf)
