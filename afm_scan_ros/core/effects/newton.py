"""Solves an increasing function of one unknown by Newton's or Halley's steps between bounds."""

import math

import numpy as np

from afm_scan_ros.core.compiled import compiled, inlined
from afm_scan_ros.core.effects.hysteresis.everett import BeyondRangeError
from afm_scan_ros.core.errors import SampleError
from afm_scan_ros.core.types import Array

EXACT = 1e-13
"""Share of the function's range; the share that rounding limits it to."""
ROUNDS = 100
LARGEST_CORRECTION = 0.5
"""Of the slope, by the curvature: beyond, the curvature holds no longer."""


@inlined
def first_try(k: int, wanted: Array, u: float, last: float, bounds: tuple[float, float]) -> float:
    """Return the first try for a sample: on as from ``last`` to ``u``, in proportion to what grows.

    What is ``wanted`` may grow up to twice as much as it did in the sample before.
    """
    grown = 1.0
    if k > 1 and wanted[k - 1] != wanted[k - 2]:
        grown = (wanted[k] - wanted[k - 1]) / (wanted[k - 1] - wanted[k - 2])
    there = u + min(max(grown, 0.0), 2.0) * (u - last)
    return min(max(there, bounds[0]), bounds[1])


@inlined
def halley(miss: float, slope: float, curvature: float) -> float:
    """Return Halley's step towards a miss of zero, Newton's without a curvature.

    Where the function is level the step has no end, so that ``next_try`` takes the middle.
    """
    if not slope > 0.0:
        return math.copysign(np.inf, -miss)
    step = -miss / slope
    share = -0.5 * step * curvature / slope
    return step / (1.0 - min(max(share, -LARGEST_CORRECTION), LARGEST_CORRECTION))


@compiled
def next_try(
    u: float, step: float, tried: tuple[float, float], bounds: tuple[float, float]
) -> float:
    """Return a step's end; where it leaves the bracket, the bracket's middle or the outer bound."""
    there = u + step
    if tried[0] < there < tried[1]:
        return there
    side = 0 if step < 0.0 else 1
    return bounds[side] if tried[side] == bounds[side] else 0.5 * (tried[0] + tried[1])


def refuse_unsolved(solved: int, wanted: Array, found: Array) -> None:
    """Raise for the sample after those ``solved``, if any, of effective inputs ``wanted`` (V).

    What was ``found`` there is the nearest within reach, which raises BeyondRangeError; or it is
    NaN, where ROUNDS steps did not suffice, which raises SampleError.
    """
    if solved == len(wanted):
        return
    value, reached = float(wanted[solved]), float(found[solved])
    if np.isfinite(reached) or not np.isfinite(value):
        raise BeyondRangeError(solved, value, reached)
    raise SampleError(
        solved,
        f"no drive was found for an effective input of {value:.6g} V in {ROUNDS} steps: identify"
        " the hysteresis anew, or remove what was added to it",
    )
