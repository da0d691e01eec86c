"""The proper prior that the evidence of the diagnosis stands for, as a map of the unit cube.

Laplace's method needs the density of the prior at the fitted values alone. Nested sampling needs
all of it, so the range of an amount is placed here: it adds between the sensor's noise and the
motion of the record, by the response at the fitted value.
"""

from collections.abc import Iterator, Sequence

import numpy as np
from attrs import frozen

from afm_scan_ros.core.diagnosis.candidates import CandidateFitter, FittedCandidates
from afm_scan_ros.core.diagnosis.fit import inserted
from afm_scan_ros.core.diagnosis.parameter_layout import ParameterLayout
from afm_scan_ros.core.types import Array

TINY = float(np.finfo(float).tiny)


@frozen
class LogUniform:
    """Number whose distance from ``centre`` is uniform in the logarithm, between two limits.

    It lies on one side of the centre, +1 or -1, or on either: ``sides``.
    """

    centre: float
    least: float
    largest: float
    sides: tuple[float, ...] = (1.0,)

    @property
    def width(self) -> float:
        """Width of the logarithm, all sides together."""
        return len(self.sides) * float(np.log(self.largest / self.least))

    def at(self, quantile: float) -> float:
        """Value at a quantile from 0 to 1."""
        which = min(int(quantile * len(self.sides)), len(self.sides) - 1)
        share = quantile * len(self.sides) - which
        distance = self.least * (self.largest / self.least) ** share
        return float(self.centre + self.sides[which] * distance)

    def density(self, value: float) -> float:
        """Probability density at a value within the limits."""
        return 1.0 / (self.width * abs(value - self.centre))


@frozen(eq=False)
class Prior:
    """Prior of the free numbers (f,) of a fit: of each a distribution, or a value that is known."""

    layout: ParameterLayout
    numbers: tuple[LogUniform | float, ...]

    @property
    def unknown(self) -> tuple[LogUniform, ...]:
        """Distributions of the numbers that are not known."""
        return tuple(one for one in self.numbers if isinstance(one, LogUniform))

    def at(self, cube: Array) -> Array:
        """Values (unknown,) at a point (unknown,) of the unit cube."""
        return np.array([one.at(point) for one, point in zip(self.unknown, cube, strict=True)])

    def values(self, unknown: Array) -> Array:
        """Free numbers (f,), of which some are ``unknown``."""
        given = iter(unknown)
        return np.array([next(given) if isinstance(n, LogUniform) else n for n in self.numbers])

    def allows(self, values: Array) -> bool:
        """Whether the free numbers (f,) lie within the bounds of a fit."""
        inside = zip(_bounds(self.layout), values, strict=True)
        return all(lower <= value <= upper for (lower, upper), value in inside)


def prior_of(fitter: CandidateFitter, trial: FittedCandidates) -> Prior:
    """Prior of the free numbers of a trial, whose density is that of Laplace's method there."""
    forms = [candidate.form for candidate in trial.candidates]
    reach = max(each.reach for each in fitter.evidence)
    layout = ParameterLayout(forms, len(fitter.evidence), reach)
    values, neutral = layout.free(trial.fit.rows), layout.each("neutral")
    without = (np.where(np.arange(len(values)) == i, neutral, values) for i in range(len(values)))
    places = [_place(fitter, trial, layout.rows(each)) for each in without]
    return Prior(layout, tuple(distributions(layout, values, places, fitter.span)))


def distributions(
    layout: ParameterLayout, values: Array, places: Sequence[float], span: float
) -> Iterator[LogUniform | float]:
    """Yield the prior of each free number about its value, whose ``places`` are those of amounts.

    Of amounts the logarithm ranges over ``span``.
    """
    amounts = layout.each_amplitude()
    bounds, located, neutral = _bounds(layout), layout.each("located"), layout.each("neutral")
    for i, value in enumerate(map(float, values)):
        if located[i]:
            yield value
        elif amounts[i]:
            yield amount(value, float(neutral[i]), bounds[i], places[i], span)
        else:
            yield LogUniform(0.0, *bounds[i])


def _bounds(layout: ParameterLayout) -> list[tuple[float, float]]:
    lower, upper = layout.each("lower"), layout.each("upper")
    return list(zip(lower.tolist(), upper.tolist(), strict=True))


def amount(
    value: float, neutral: float, bounds: tuple[float, float], place: float, span: float
) -> LogUniform:
    """Prior of an amount of an effect, of which ``value`` has a ``place`` from 0, least, to 1.

    The amount is the distance from ``neutral``, or from zero where that is nearer.
    """
    either = bounds[0] < neutral < bounds[1]
    if abs(value) < abs(value - neutral):
        width = span * (1.0 + either)
        least = abs(value) * float(np.exp((place - 1.0) * width))
        return LogUniform(0.0, least, least * float(np.exp(width)), (float(np.sign(value)),))
    side = 1.0 if value > neutral else -1.0
    away, bound = abs(value - neutral), abs(bounds[int(value > neutral)] - neutral)
    largest = max(min(away * float(np.exp((1.0 - place) * span)), bound), away)
    least = largest * float(np.exp(-span))
    return LogUniform(neutral, least, largest, (-1.0, 1.0) if either else (side,))


def _place(fitter: CandidateFitter, trial: FittedCandidates, without: Array) -> float:
    """Place between noise and motion, in the logarithm, of what a number adds at its value.

    It is negative where that is less than the noise.
    """
    forms = [candidate.form for candidate in trial.candidates]
    both = trial.extended(fitter.chain), inserted(fitter.chain, forms, without)
    playbacks = [each.playback for each in fitter.evidence]
    added = max(float(np.std(p.displacement(both[0]) - p.displacement(both[1]))) for p in playbacks)
    moved = max(float(p.view.measured.std()) for p in playbacks)
    return 1.0 + float(np.log(np.clip(added / moved, TINY, 1.0))) / fitter.span
