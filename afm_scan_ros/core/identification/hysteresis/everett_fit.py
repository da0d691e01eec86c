"""First-order reversal curves → the Everett surfaces of the hysteresis and of its inverse."""

from collections.abc import Sequence

import numpy as np
from attrs import evolve, frozen
from scipy.optimize import brentq

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.hysteresis.everett_equations import EverettGrid
from afm_scan_ros.core.identification.hysteresis.everett_least_squares import (
    FittedSurface,
    fit_surface,
)
from afm_scan_ros.core.identification.hysteresis.reversal_curves import (
    ReversalCurve,
    ReversalCurves,
    can_judge,
    drive_error,
    fresh_loops,
    is_better,
)
from afm_scan_ros.core.model import DIRECT, HysteresisModel
from afm_scan_ros.core.types import Array

LEVELS = 121
"""Levels of alpha and beta: two to each curve of our own record."""
TERMS = 4
"""Coefficients of a map behind the hysteresis, where one is fitted."""
BIAS, TOLERANCE = 0.1, 1e-6
"""Largest bias sought, over the drive's range, and to what share of it."""
UNLIKE, UNLIKE_RANGE = 0.5, 0.01
"""Share of what a straight line misses, and of the output's range, that a surface may miss.

Beyond both, most of what bends the curves is no hysteresis that has an inverse.
"""


@frozen(eq=False)
class EverettFit:
    """Both surfaces, which rise, and the ``model`` that they make.

    ``closure`` is by how much F (V) differs from return to return to the same saturation.
    """

    model: HysteresisModel
    forward: FittedSurface
    direct: FittedSurface
    closure: float

    @property
    def effective_range(self) -> float:
        """Range of F from saturation to saturation, V."""
        return self.model.surface.output_upper - self.model.surface.output_lower

    @property
    def noise(self) -> float:
        """Standard deviation of F (V) on the curves from that of the forward surface.

        It holds noise and, where minor loops are not congruent, what no surface can represent.
        """
        return self.forward.noise


def fit_everett(
    drive: Array, effective: Array, curves: ReversalCurves, forward: FittedSurface
) -> EverettFit:
    """Add the direct inverse to a forward surface, and choose between its inverse and that.

    The direct surface is from effective input F (V) to drive (V), both (n,), F freed of creep and
    vibration. Its levels are as many and lie alike; held-out points choose its penalty's strength.
    """
    bottoms, tops = curves.saturations(effective)
    grid = forward.grid.stretched(bottoms.mean(), tops.mean())
    exchanged = [curve.exchanged() for curve in curves.of(drive, effective)]
    direct = evolve(fit_surface(exchanged, grid).monotone(), bias=forward.bias)
    closure = max(float(np.ptp(bottoms)), float(np.ptp(tops)))
    model = HysteresisModel(forward.surface, direct.surface, forward.output)
    after = drive[curves.end :]
    if can_judge(after):
        fresh = fresh_loops(model, drive, effective, curves.end)
        if is_better(fresh.direct, fresh.exact, after):
            model = evolve(model, inverse=DIRECT)
    return EverettFit(model, forward, direct, closure)


def fit_forward(
    drive: Array,
    effective: Array,
    curves: ReversalCurves,
    levels: int = LEVELS,
    strength: float | None = None,
    terms: int = 0,
) -> FittedSurface:
    """Surface from drive (V) to effective input F (V), both (n,), F freed of creep and vibration.

    It has ``levels`` levels, as dense as curves turn. Held-out points choose the penalty's
    ``strength`` unless it is given. Behind it is a map of so many ``terms``. Where curves cross, it
    is the nearest surface that has an inverse. Its depolarised state is that in which a record from
    0 V begins.
    Raises InputError where that surface predicts little better than a straight line.
    """
    found = curves.of(drive, effective)
    turns = np.array([curve.turn for curve in found])
    grid = EverettGrid.by_turns(turns, drive.min(), drive.max(), levels)
    forward = fit_surface(found, grid, strength, terms=terms).monotone()
    _refuse_unlike(forward, found)
    if drive[0] != 0.0:
        return forward
    rest = int(np.argmax(drive != 0.0))
    return evolve(forward, bias=_bias(forward, float(np.mean(effective[:rest]))))


def _bias(fitted: FittedSurface, rest: float) -> float:
    """Bias with which the depolarised output is F at ``rest`` (V); 0 where none within BIAS is."""

    def excess(bias: float) -> float:
        operator = evolve(fitted, bias=bias).operator
        output: float = operator.apply(operator.at_rest(), np.zeros(1))[1][0]
        return output - rest

    farthest = BIAS * (fitted.grid.upper - fitted.grid.lower)
    if excess(-farthest) * excess(farthest) >= 0.0:
        return 0.0
    found: float = brentq(excess, -farthest, farthest, xtol=TOLERANCE * farthest)
    return found


def terms_that_serve(
    drive: Array, effective: Array, curves: ReversalCurves, before: FittedSurface
) -> int:
    """Coefficients of the map behind the hysteresis: TERMS where fresh loops confirm it, or none.

    Levels and strength are those of the surface ``before``; drive and F, both (n,), are in V.
    """

    def error(terms: int) -> Array:
        fit = fit_forward(drive, effective, curves, before.grid.size, before.strength, terms)
        start = curves.end
        return drive_error(fit.surface, fit.output, drive[start:], effective[start:])

    if not can_judge(drive[curves.end :]):
        return 0
    try:
        mapped = error(TERMS)
    except InputError:  # the map does not rise
        return 0
    return TERMS if is_better(mapped, error(0), drive[curves.end :]) else 0


def _refuse_unlike(fitted: FittedSurface, curves: Sequence[ReversalCurve]) -> None:
    """Raise InputError where a rising surface misses most of what a straight line misses."""
    inputs, outputs = (
        np.concatenate([getattr(curve, name) for curve in curves]) for name in ("inputs", "outputs")
    )
    missed = np.std(np.concatenate([fitted.predict(curve) for curve in curves]) - outputs)
    bent = np.std(np.polyval(np.polyfit(inputs, outputs, 1), inputs) - outputs)
    if missed > max(UNLIKE * bent, UNLIKE_RANGE * np.ptp(outputs)):
        raise InputError(
            "hysteresis record: its curves cross, and no hysteresis that has an inverse is like"
            f" them: the nearest misses {missed / bent:.0%} of what a straight line misses; record"
            " them again, slower or with less noise, after a creep record of the same scanner, each"
            " at the sample rate that it says"
        )
