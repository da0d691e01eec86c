"""Which free numbers of a fit are the parameters of effects in each record."""

import math
from collections.abc import Sequence

import numpy as np
from attrs import evolve
from numpy.typing import NDArray

from afm_scan_ros.core.effects.effect_type import EffectForm, EffectParameter
from afm_scan_ros.core.types import Array


def _within(parameter: EffectParameter, reach: float) -> EffectParameter:
    """Return a parameter whose frequency, if excited, ends where the records show motion (Hz)."""
    if not parameter.excited or reach >= parameter.upper:
        return parameter
    return evolve(parameter, upper=max(reach, 2.0 * parameter.lower))


def _amplitudes(form: EffectForm) -> list[bool]:
    zero = [p.neutral == 0.0 for p in form.parameters]
    return zero if any(zero) else [True] * len(zero)


class ParameterLayout:
    """Maps values (r, p) of p parameters in r records to the free numbers (f,) of a fit."""

    def __init__(
        self,
        forms: Sequence[EffectForm],
        records: int,
        reach: float = math.inf,
        samples: int = 2,
    ) -> None:
        self._samples = samples
        self.parameters = [_within(p, reach) for form in forms for p in form.parameters]
        own = np.array([p.own for p in self.parameters])
        self._amplitudes = np.array([a for form in forms for a in _amplitudes(form)], dtype=float)
        index = np.tile(np.arange(len(own)), (records, 1))
        further = (records - 1, int(own.sum()))
        index[1:, own] = len(own) + np.arange(np.prod(further)).reshape(further)
        self._index = index
        self.count = int(index.max()) + 1

    def each_amplitude(self) -> NDArray[np.bool_]:
        """Which free numbers (f,) are amounts of an effect, rather than its time or frequency."""
        return self.free(np.tile(self._amplitudes, (len(self._index), 1))) > 0.0

    def prior_widths(self, values: Array, span: float) -> Array:
        """Widths (f,) of the prior of free numbers about their values.

        Priors are uniform in the logarithm, Jeffreys' for a scale: of an amount over ``span`` on
        either side of none that its range allows, of other numbers over their range. That of the
        frequency of a spectral line is what a record of so many samples shows.
        """
        neutral, lower, upper = (self.each(name) for name in ("neutral", "lower", "upper"))
        away = np.abs(values - neutral)
        amount = np.where(neutral == 0.0, away, np.minimum(away, np.abs(values)))
        amplitude, sides = self.each_amplitude(), 1.0 + ((lower < neutral) & (neutral < upper))
        with np.errstate(divide="ignore", invalid="ignore"):
            ranges = np.log(np.where(amplitude, 2.0, upper / lower))
        ranges = np.where(self.each("located") > 0.0, np.log(0.5 * self._samples), ranges)
        widths = np.where(amplitude, sides * span * amount, ranges * values)
        return np.asarray(widths / np.sqrt(2.0 * np.pi))

    def of_parameters(self, part: slice) -> NDArray[np.bool_]:
        """Which free numbers (f,) are of some of the parameters."""
        chosen = np.zeros(len(self.parameters))
        chosen[part] = 1.0
        return self.free(np.tile(chosen, (len(self._index), 1))) > 0.0

    @property
    def own(self) -> tuple[int, ...]:
        """Free numbers that belong to one record, parameter by parameter."""
        which = [p.own for p in self.parameters]
        return tuple(int(i) for i in self._index[:, which].T.ravel())

    def records_of(self, number: int) -> set[int]:
        """Records that a free number has an influence on."""
        return set(np.flatnonzero(np.any(self._index == number, axis=1)).tolist())

    def rows(self, free: Array) -> Array:
        """Values (r, p) of the free numbers (f,)."""
        return np.asarray(free[self._index])

    def free(self, rows: Array) -> Array:
        """Free numbers (f,) of values (r, p); shared parameters have the first record's value."""
        numbers = np.empty(self.count)
        numbers[self._index[::-1]] = rows[::-1]
        return numbers

    def of_further_record(self, widths: Array, inner: Array) -> Array:
        """Standard deviations (d, p) along the principal axes, of the parameters in a new record.

        The posterior has the precision ``inner`` (f, f) in units of the prior's ``widths`` (f,). A
        parameter of one record alone has its prior in another.
        """
        precision, axes = np.linalg.eigh(inner)
        precision = np.maximum(precision, 1.0)  # the prior's own, which rounding may hide
        shared = (widths[:, np.newaxis] * axes / np.sqrt(precision))[self._index[0]].T
        own = np.array([p.own for p in self.parameters])
        shared[:, own] = 0.0
        found = np.vstack((shared, np.diag(widths[self._index[0]])[own]))
        return np.asarray(found[np.any(found != 0.0, axis=1)])

    def each(self, name: str) -> Array:
        """Attribute ``name`` of the parameter of each free number (f,), such as ``lower``."""
        of_parameters = np.array([getattr(p, name) for p in self.parameters], dtype=np.float64)
        return self.free(np.tile(of_parameters, (len(self._index), 1)))
