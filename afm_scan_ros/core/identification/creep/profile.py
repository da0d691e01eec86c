"""Profile-likelihood intervals of a creep series: how far each parameter may go before it shows.

A parameter is moved from its best value, all others are fitted anew, and the 95 % interval ends
where the squared error has grown by t² s²: s² is the error's variance for as many stretches as are
left over, t Student's quantile (Bates & Watts, Nonlinear Regression Analysis, 1988, ch. 6). The
noise is taken as white, its size from the fit itself.
"""

from collections.abc import Mapping

import numpy as np
from scipy.optimize import brentq
from scipy.stats import t as student

from afm_scan_ros.core.identification.creep.record import CreepRecord
from afm_scan_ros.core.identification.creep.series import FASTEST, SLOWEST, Held, Series, refine

LEVEL = 0.95
FIRST_STRIDE = 0.01
"""First distance tried from the best value, relative; each next one is twice as far."""
FARTHEST = np.log(1e3)
"""Logarithm of the factor at which an interval that has not closed counts as open."""

Interval = tuple[float, float]


def intervals(record: CreepRecord, best: Series) -> Mapping[str, Interval]:
    """95 % interval of ``gain_1``, ``time_constant_1`` (s), …, elements counted from the fastest.

    ``record`` is the averaged one that ``best`` was fitted to. An open interval ends at 0 or inf.
    A gain grows with its time constant without end, so it is open where that one is.
    """
    found: dict[str, Interval] = {}
    for element, (gain, tau) in enumerate(zip(best.gains, best.time_constants, strict=True)):
        slowest = np.log(SLOWEST * record.longest / tau)
        constant = _Profile(record, best, "time_constant", element)
        low, high = constant.end(-1.0, np.log(tau / FASTEST)), constant.end(1.0, slowest)
        profile = _Profile(record, best, "gain", element)
        farthest = FARTHEST if np.isfinite(high) else 0.0
        ends = gain * profile.end(-1.0, FARTHEST), gain * profile.end(1.0, farthest)
        found[f"gain_{element + 1}"] = float(min(ends)), float(max(ends))
        found[f"time_constant_{element + 1}"] = float(tau * low), float(tau * high)
    return found


class _Profile:
    """The growth of the squared error along one parameter, over what 95 % allow, less one."""

    def __init__(self, record: CreepRecord, best: Series, parameter: str, element: int) -> None:
        free = len(record.first) - 1 - 2 * len(best.gains) - len(best.slopes)
        quantile = float(student.ppf(0.5 + LEVEL / 2.0, free))
        self._allowed = quantile**2 * best.cost / free
        self._record, self._best, self._last = record, best, best
        self._parameter, self._element = parameter, element
        self._value = {"gain": best.gains, "time_constant": best.time_constants}[parameter][element]

    def _growth(self, logarithm: float) -> float:
        held = Held(self._parameter, self._element, self._value * np.exp(logarithm))
        self._last = refine(self._record, self._last, held)
        return (self._last.cost - self._best.cost) / self._allowed - 1.0

    def end(self, direction: float, farthest: float) -> float:
        """Return the factor on the best value where 95 % end, in one direction (±1).

        It is 0 or inf where they do not end within a factor of exp(±farthest).
        """
        self._last = self._best
        before, stride = 0.0, FIRST_STRIDE
        while stride < farthest:
            if self._growth(direction * stride) > 0.0:
                return float(np.exp(direction * self._root(direction, before, stride)))
            before, stride = stride, 2.0 * stride
        return np.inf if direction > 0.0 else 0.0

    def _root(self, direction: float, before: float, after: float) -> float:
        return float(brentq(lambda s: self._growth(direction * s), before, after, xtol=1e-5))
