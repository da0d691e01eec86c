"""The parameters of one axis of the simulated scanner: hysteresis, vibration, modes, creep.

Numbers have their unit in the plant file, and their valid range.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from attrs import field, frozen
from attrs.validators import ge, gt, le, lt

from afm_scan_ros.core.errors import InputError

DISTINCT = 1e-4  # relative; roots of a triple pole come out 1e-5 apart


def quantity(*checks: Callable[..., Any], suffix: str = "", scale: float = 1.0) -> Any:  # noqa: ANN401 - attrs types the field by its annotation
    """Declare a number: SI inside, ``name + suffix`` times ``scale`` in the file."""
    return field(validator=list(checks), metadata={"suffix": suffix, "scale": scale})


@frozen
class HysteresisSpec:
    """Play operators of exponentially falling density between two quadratics (see play.py)."""

    elements: int = quantity(ge(1), le(10_000))
    threshold_max: float = quantity(gt(0.0), suffix="_v")
    density: float = quantity(ge(0.0), suffix="_per_v")
    decay: float = quantity(gt(0.0), suffix="_v")
    gain: float = quantity(gt(0.0))
    input_quadratic: float = quantity(suffix="_per_v")
    output_quadratic: float = quantity(suffix="_per_v")


@frozen
class RationalSpec:
    """A stable, proper transfer function: polynomials in s (rad/s), highest power first.

    Raises InputError where it is not stable, not proper, or has a pole twice.
    """

    numerator: tuple[float, ...]
    denominator: tuple[float, ...]

    def __attrs_post_init__(self) -> None:
        if not self.denominator or self.denominator[0] == 0.0:
            raise InputError("denominator must begin with a coefficient other than 0")
        if not 0 < len(self.numerator) <= len(self.denominator):
            raise InputError("numerator must have 1 coefficient or more, denominator no fewer")
        poles = np.roots(self.denominator)
        if np.any(poles.real >= 0.0):
            raise InputError(f"denominator has the unstable root {max(poles, key=np.real):.6g}/s")
        apart = np.abs(poles[:, None] - poles) + np.diag(np.abs(poles))
        if np.any(apart < DISTINCT * np.abs(poles)):
            raise InputError("denominator has a root twice; move one of the two a little")


@frozen
class ModeSpec:
    """A resonance beside the polynomials; its peak is a share of the polynomials' highest."""

    frequency: float = quantity(gt(0.0), le(1e9), suffix="_hz")
    damping: float = quantity(gt(0.0), lt(0.7))
    relative_peak: float = quantity(gt(0.0), le(1.0))


@frozen
class AxisSpec:
    """One axis: hysteresis (V to V), vibration (sensor volts per V) with modes, creep (1)."""

    hysteresis: HysteresisSpec
    vibration: RationalSpec
    modes: tuple[ModeSpec, ...]
    creep: RationalSpec

    def __attrs_post_init__(self) -> None:
        if len(self.vibration.numerator) == len(self.vibration.denominator):
            raise InputError("vibration: numerator must be of lower order than denominator")
        fastest = max(np.abs(np.roots(self.creep.denominator)), default=0.0)
        if fastest >= min(np.abs(np.roots(self.vibration.denominator))):
            raise InputError(f"creep has a root of {fastest:.6g}/s, as fast as the vibration's")
