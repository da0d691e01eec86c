"""One candidate fitted to the records: its parameters by nonlinear least squares."""

from collections.abc import Iterable, Sequence

import numpy as np
from attrs import frozen
from scipy.optimize import least_squares

from afm_scan_ros.core.catalogue.entry import Form
from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.tracing.evidence import Evidence
from afm_scan_ros.core.types import Array

ROUNDS = 12
TOLERANCE = 1e-4
"""Relative change of the cost, or of the parameters, that ends a fit: rivals differ by far more."""


SYSTEMATIC = 0.3
"""Share of the floor's power that may lie along a parameter's influence: what is left of a good
model is no noise but a pattern, which the record repeats and no averaging removes."""
CONFIDENT = 1.96


@frozen(eq=False)
class Fit:
    """Values (p,) of forms' parameters in SI units, their covariance (p, p), and the cost.

    The cost is the mean square of the excess over the samples that teach, summed over records.
    """

    values: Array
    covariance: Array
    cost: float

    @property
    def halfwidth(self) -> Array:
        """Half the 95 % interval of each parameter, shape (p,)."""
        return CONFIDENT * np.sqrt(np.diag(self.covariance))


def inserted(chain: Chain, forms: Sequence[Form], values: Array) -> Chain:
    """Chain with all forms, one after the other, at their parameters' values (p,)."""
    first = 0
    for form in forms:
        count = len(form.parameters)
        chain = form.insert(chain, values[first : first + count])
        first += count
    return chain


class _Problem:
    """Excess of the teaching samples as a function of the parameters."""

    def __init__(self, evidence: Sequence[Evidence], chain: Chain, forms: Sequence[Form]) -> None:
        self._evidence, self._chain, self._forms = evidence, chain, forms
        parameters = [p for form in forms for p in form.parameters]
        self.steps = np.array([p.step for p in parameters])
        self.lower = np.array([p.lower for p in parameters])
        self.upper = np.array([p.upper for p in parameters])

    def excess(self, values: Array) -> Array:
        """Excess of all teaching samples, each record with the same total weight."""
        chain = inserted(self._chain, self._forms, np.clip(values, self.lower, self.upper))
        parts = (
            each.excess(chain)[each.teaches] / np.sqrt(each.teaches.sum())
            for each in self._evidence
        )
        return np.concatenate(list(parts))

    def jacobian(self, values: Array) -> Array:
        """Differences over one step, taken inwards at a bound."""
        here, columns = self.excess(values), []
        for i, step in enumerate(self.steps):
            signed = step if values[i] + step <= self.upper[i] else -step
            there = values.copy()
            there[i] += signed
            columns.append((self.excess(there) - here) / signed)
        return np.column_stack(columns)


def fit(
    evidence: Sequence[Evidence],
    chain: Chain,
    forms: Sequence[Form],
    starts: Iterable[Sequence[float]],
) -> Fit | None:
    """Best fit of all forms together from any of the starts (p,) of their parameters.

    None where they cannot be applied from any of them.
    """
    problem = _Problem(evidence, chain, forms)
    best: Fit | None = None
    for start in starts:
        found = _descend(problem, np.clip(start, problem.lower, problem.upper))
        if found and (best is None or found.cost < best.cost):
            best = found
    return best


def _descend(problem: _Problem, start: Array) -> Fit | None:
    try:
        found = least_squares(
            problem.excess,
            start,
            jac=problem.jacobian,
            bounds=(problem.lower, problem.upper),
            x_scale="jac",
            max_nfev=ROUNDS,
            ftol=TOLERANCE,
            xtol=TOLERANCE,
        )
    except (InputError, ScanError, np.linalg.LinAlgError):
        return None
    return Fit(found.x, SYSTEMATIC * _inverse(found.jac), float(2.0 * found.cost))


def _inverse(jacobian: Array) -> Array:
    """Inverse of JᵀJ for columns of very unlike size; infinite where one has no influence."""
    size = np.linalg.norm(jacobian, axis=0)
    if not np.all(size > 0.0):
        return np.full((len(size), len(size)), np.inf)
    alike = jacobian / size
    return np.asarray(np.linalg.pinv(alike.T @ alike) / np.outer(size, size))
