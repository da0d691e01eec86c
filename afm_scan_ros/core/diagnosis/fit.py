"""Fits forms of effects to the records by nonlinear least squares.

A parameter is shared by all records, or has its own value in each record.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence

import numpy as np
from attrs import evolve, field, frozen
from numpy.typing import NDArray

from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.diagnosis.evidence import Evidence
from afm_scan_ros.core.diagnosis.least_squares import minimised
from afm_scan_ros.core.diagnosis.parameter_layout import ParameterLayout
from afm_scan_ros.core.effects.effect_type import EffectForm
from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.model import CONFIDENT
from afm_scan_ros.core.types import Array

ALL = slice(None)
STEP_SHARES = (1.0, 0.2)
SECANTS = 0.06, 0.02, 0.006, 0.002
"""Half-widths of the secants of the first steps from a start, over a parameter that spans decades.

Where turns of the motion shift, as by a slew limit, a tangent holds over a thousandth of it.
"""


@frozen(eq=False)
class Fit:
    """Parameters ``rows`` (r, p) in SI units, one row per record, and half their 95 % intervals.

    ``halfwidth`` (p,) is that of the first record. ``log_volume`` is that of the posterior over the
    prior's. ``deviations`` (d, p) are standard deviations of the values in a further record, along
    the principal axes of their distribution.
    """

    rows: Array
    halfwidth: Array
    log_volume: float = 0.0
    deviations: Array = field(factory=lambda: np.empty((0, 0)))

    @property
    def values(self) -> Array:
        """Values (p,) in the first record."""
        return np.asarray(self.rows[0])


class BaseRidge:
    """Integrates over parameters of the base model whose prior is normal.

    ``influences`` (n,) are those of one standard deviation of each on a weighted residual (n,).
    With A its transpose the residual has the covariance I + A Aᵀ. Its inverse square root is
    I - A V diag(1 / (q (1 + q))) Vᵀ Aᵀ, where V diag(q² - 1) Vᵀ is the influence's Gram matrix.
    """

    def __init__(self, influences: Array) -> None:
        self._influence = np.atleast_2d(influences)
        values, axes = np.linalg.eigh(self._influence @ self._influence.T)
        root = np.sqrt(1.0 + np.maximum(values, 0.0))
        self._inner = (axes / (root * (1.0 + root))) @ axes.T

    def left(self, residual: Array) -> Array:
        """Residual (n,) times the inverse square root of its covariance."""
        if not self._influence.size:
            return residual
        along = self._inner @ (self._influence @ residual)
        return np.asarray(residual - along @ self._influence)


class Problem:
    """Forms to be fitted together: the weighted residual ``seen`` of their parameters.

    Values have shape (r, p): one row per record, the forms' parameters one after the other.
    """

    def __init__(
        self,
        evidence: Sequence[Evidence],
        chain: Chain,
        forms: Sequence[EffectForm],
        seen: Callable[[Evidence, Array], Array] = Evidence.whitened,
        span: float = 1.0,
    ) -> None:
        self._evidence, self._chain, self._forms, self._seen = evidence, chain, forms, seen
        reach = max(each.reach for each in evidence)
        longest = max(len(each.playback.view.drive) for each in evidence)
        self._layout, self._span = ParameterLayout(forms, len(evidence), reach, longest), span
        self._steps, self._lower, self._upper = map(self._layout.each, ("step", "lower", "upper"))
        self._spans = self._layout.each("spans_decades") > 0.0
        self._last: tuple[Array, list[Array]] | None = None
        base = [[seen(each, one) for one in each.cells.along(each.base)] for each in evidence]
        self._base = BaseRidge(np.hstack(base))

    def begin(
        self, starts: Iterable[Array], own: Iterable[Array] = (), new: slice = ALL
    ) -> tuple[Array, float] | None:
        """Best values and cost after one step from each of the starts, or one for each secant.

        Secants are taken of the parameters that are ``new`` and span decades. ``own`` is the result
        of ``influence_of_selected`` for the first forms, at their starting values. None where the
        forms cannot be applied from any start.
        """
        known = dict(zip(self._layout.own, own, strict=False))
        spans = self._spans & self._layout.of_parameters(new)
        found = (self._begun(self._bounded(start), known, spans) for start in starts)
        best = min((f for f in found if f), key=lambda f: f[1], default=None)
        return (self._layout.rows(best[0]), best[1]) if best else None

    def influence_of_selected(self, rows: Array) -> tuple[Array, ...]:
        """Influence (n,) on the residual of each value that a record has of its own.

        ``rows`` (r, p) are the values. These parameters add to the displacement, so effects
        inserted later hardly change their influence.
        """
        values = self._bounded(rows)
        return tuple(self._influence(values, i) for i in self._layout.own)

    def descend(self, start: Array) -> Fit | None:
        """Fit from a start; None where the forms cannot be applied on the way."""
        try:
            free, slope = minimised(
                self._excess,
                lambda values: self._jacobian(values, {}, None),
                self._bounded(start),
                (self._lower, self._upper),
            )
        except (InputError, ScanError, np.linalg.LinAlgError):
            return None
        halves = CONFIDENT * np.sqrt(np.diag(_inverse(slope)))
        rows = self._layout.rows
        widths = self._layout.prior_widths(free, self._span)
        scaled = slope * widths
        inner = np.eye(len(widths)) + scaled.T @ scaled  # by Laplace's method
        volume = float(-0.5 * np.linalg.slogdet(inner)[1])
        deviations = self._layout.of_further_record(widths, inner)
        return Fit(rows(free), rows(halves)[0], volume, deviations)

    def _bounded(self, rows: Array) -> Array:
        return np.clip(self._layout.free(rows), self._lower, self._upper)

    def _begun(
        self, start: Array, known: Mapping[int, Array], spans: NDArray[np.bool_]
    ) -> tuple[Array, float] | None:
        """One step for each secant where some numbers ``spans`` (f,) take them, else one."""
        found: tuple[Array, float] | None = start, np.inf
        for width in SECANTS if spans.any() else (0.0,):
            found = self._stepped(found[0], known, np.where(spans, width, 0.0)) if found else None
        return found

    def _stepped(
        self, start: Array, known: Mapping[int, Array], widths: Array
    ) -> tuple[Array, float] | None:
        """One Gauss-Newton step, shortened until it helps; some influences are ``known``."""
        try:
            here, slope = self._excess(start), self._jacobian(start, known, widths)
            best = start, float(here @ here)
            size = np.maximum(np.linalg.norm(slope, axis=0), np.finfo(float).tiny)
            step = -np.linalg.lstsq(slope / size, here, rcond=1e-10)[0] / size
            for share in STEP_SHARES:
                there = np.clip(start + share * step, self._lower, self._upper)
                left = self._excess(there)
                if left @ left < best[1]:
                    return there, float(left @ left)
        except (InputError, ScanError, np.linalg.LinAlgError):
            return None
        return best

    def _excess(self, values: Array) -> Array:
        """Weighted residuals of all records, at values that are free."""
        return self._base.left(np.concatenate(self._parts(values)))

    def _parts(self, values: Array) -> list[Array]:
        """Weighted residual of each record.

        The last result is cached, since differences are taken at the values of the last step.
        """
        if not (self._last and np.array_equal(values, self._last[0])):
            every = range(len(self._evidence))
            self._last = values.copy(), [self._part(values, record) for record in every]
        return self._last[1]

    def _part(self, values: Array, record: int) -> Array:
        evidence = self._evidence[record]
        chain = inserted(self._chain, self._forms, self._layout.rows(values))
        return self._seen(evidence, evidence.coefficients(chain))

    def _jacobian(self, values: Array, known: Mapping[int, Array], widths: Array | None) -> Array:
        found = []
        for i in range(len(values)):
            if widths is not None and widths[i]:
                found.append(self._secant(values, i, float(widths[i])))
            else:
                found.append(known[i] if i in known else self._influence(values, i))
        return np.column_stack(found)

    def _secant(self, values: Array, i: int, width: float) -> Array:
        """Difference quotient from below a value to above it, by a share of it."""
        ends = []
        for share in (-width, width):
            there = values.copy()
            there[i] = np.clip((1.0 + share) * values[i], self._lower[i], self._upper[i])
            ends.append((there[i], self._excess(there)))
        (low, below), (high, above) = ends
        return np.asarray((above - below) / (high - low))

    def _influence(self, values: Array, i: int) -> Array:
        """Difference quotient, taken inwards at a bound, of the records that a number is of."""
        step = self._steps[i]
        signed = step if values[i] + step <= self._upper[i] else -step
        there, here = values.copy(), self._parts(values)
        there[i] += signed
        records = self._layout.records_of(i)
        found = [
            self._part(there, record) - part if record in records else np.zeros_like(part)
            for record, part in enumerate(here)
        ]
        return self._base.left(np.concatenate(found) / signed)


def _inverse(jacobian: Array) -> Array:
    """Inverse of JᵀJ with scaled columns; infinite where one has no influence."""
    size = np.linalg.norm(jacobian, axis=0)
    if not np.all(size > 0.0):
        return np.full((len(size), len(size)), np.inf)
    equivalent = jacobian / size
    return np.asarray(np.linalg.pinv(equivalent.T @ equivalent) / np.outer(size, size))


def inserted(chain: Chain, forms: Sequence[EffectForm], rows: Array) -> Chain:
    """Chain with all forms, one after the other, at their values (r, p) in each record."""
    first, *further = (_inserted(chain.of_record(i), forms, row) for i, row in enumerate(rows))
    return evolve(first, elsewhere=tuple(further))


def _inserted(chain: Chain, forms: Sequence[EffectForm], values: Array) -> Chain:
    begin = 0
    for form in forms:
        count = len(form.parameters)
        chain = form.insert(chain, values[begin : begin + count])
        begin += count
    return chain
