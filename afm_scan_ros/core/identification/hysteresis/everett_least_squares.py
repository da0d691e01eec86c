"""The Everett surface that fits reversal curves best, as smooth as held-out points want it.

Least squares over all points, with the third differences of E along alpha and along beta for a
penalty: Rayleigh's law at small signals, quadratic in alpha - beta, costs nothing. The penalty's
strength is the least of STRENGTHS that predicts every fifth point from the others as well as any.
(Whole curves held out would need a larger one: curves turn at the levels, so that the data on a
level go with its curve.) A level without data is neither fitted nor predicted.
A map behind the operator is fitted with it where ``terms`` of one are asked for: with its inverse,
a polynomial in the outputs, the equations stay linear.
Source of the penalty: P. H. C. Eilers, Analytical Chemistry 75 (2003), 3631 (Whittaker's
smoother).
"""

from collections.abc import Sequence

import numpy as np
from attrs import evolve, frozen
from scipy import sparse

from afm_scan_ros.core.effects.base import Cascade
from afm_scan_ros.core.effects.hysteresis.everett import EverettSurface
from afm_scan_ros.core.effects.hysteresis.preisach import OutputMap, Preisach
from afm_scan_ros.core.effects.hysteresis.preisach import terms as map_terms
from afm_scan_ros.core.identification.hysteresis.everett_equations import (
    ENOUGH,
    EverettGrid,
    Mask,
    SurfaceEquations,
    equations,
    solved,
    solved_rising,
)
from afm_scan_ros.core.identification.hysteresis.reversal_curves import ReversalCurve
from afm_scan_ros.core.types import Array

POINTS = 8
"""Points of a curve per level that are kept, each the average of its surroundings."""
HELD_OUT = 5
"""Every so many-th point is predicted from the others to choose the penalty's strength."""
STRENGTHS = tuple(10.0**exponent for exponent in range(-2, 5))
"""Strengths of the penalty to choose from: squared deviations per squared third difference."""
SLOPE = 2e-6
"""Least growth from level to level, over the surface's range, for it to have an inverse."""
INDISTINCT = 1.02
"""Held-out error, over the least, up to which a weaker penalty is preferred: it bends less."""


@frozen(eq=False)
class FittedSurface:
    """E on a grid, ``values`` (size, size), NaN where none is fitted; ``offset`` is F at ``lower``.

    ``noise`` is the standard deviation of the points from the surface, ``strength`` the penalty's.
    Behind an ``output`` map, values and noise are of the operator before it. ``bias`` is that of
    the surface.
    """

    grid: EverettGrid
    values: Array
    offset: float
    output: OutputMap | None
    noise: float
    strength: float
    _data: sparse.csc_matrix
    _normal: sparse.csc_matrix
    bias: float = 0.0

    @property
    def surface(self) -> EverettSurface:
        """The surface; raises InputError where it does not rise: see ``monotone``."""
        grid = self.grid
        known = self.values, self.offset, self.bias, grid.uneven
        return EverettSurface(grid.lower, grid.upper, *known)

    @property
    def operator(self) -> Cascade:
        """The effect from input to output; raises InputError as ``surface`` does."""
        behind = () if self.output is None else (self.output,)
        return Cascade((Preisach(self.surface), *behind))

    @property
    def terms(self) -> int:
        """Coefficients of the map behind the surface; 0 without one."""
        return 0 if self.output is None else len(self.output.coefficients)

    @property
    def unknowns(self) -> Array:
        """What equations are for: the values row by row and the offset."""
        return np.append(self.values.ravel(), self.offset)

    @property
    def scatter(self) -> float:
        """Standard deviation of the points from the surface, over the range of F."""
        return self.noise / float(np.ptp(2.0 * self.values))

    def change_from(self, before: "FittedSurface") -> float:
        """Largest change of a value from those of another fit, over the range of F."""
        return float(np.abs(self.values - before.values).max() / np.ptp(2.0 * self.values))

    def predict(self, curve: ReversalCurve) -> Array:
        """Outputs at the inputs of a curve, shape (n,), NaN where the surface does not reach."""
        outputs: Array = equations([curve], self.grid).matrix @ self.unknowns
        return outputs if self.output is None else self.output.output(outputs)

    def monotone(self) -> "FittedSurface":
        """Fit again, of the surfaces that grow with alpha and as beta falls.

        A surface that does so stays as it is.
        """
        nodes = self._nodes
        rises = _inner(_rises(self.grid.size), nodes)
        bends = () if self.output is None else self.output.coefficients
        free = np.append(self.unknowns[_free(nodes)], bends)
        found = solved_rising(self._normal, free, _widened(rises, self.terms), self._least_rise)
        surface, (offset,), bent = _parts(found, self.terms)
        output = None if self.output is None else evolve(self.output, coefficients=bent)
        values = _filled(self.grid, nodes, surface)
        return evolve(self, values=values, offset=float(offset), output=output).raised()

    def raised(self) -> "FittedSurface":
        """Raise the values that rise too little and nothing else: quick, and no longer a best fit.

        Where few values do, the operator hardly differs from that of ``monotone``.
        """
        return evolve(self, values=_raised(self.values, ENOUGH * self._least_rise))

    @property
    def _nodes(self) -> Mask:
        return self.grid.inside & np.isfinite(self.values)

    @property
    def _least_rise(self) -> float:
        return SLOPE * float(np.ptp(self.values[self._nodes]))

    def standard_errors(self) -> Array:
        """Standard errors of the values, (size, size), deviations being taken for white noise.

        What the penalty bends is not in them.
        """
        smoothing = np.linalg.inv(self._normal.toarray())
        covariance = self.noise**2 * smoothing @ (self._data @ smoothing)
        errors = np.where(np.isnan(self.values), np.nan, 0.0)
        nodes = self._nodes
        errors[nodes] = np.sqrt(np.diag(covariance)[: nodes.sum()])
        return errors


def fit_surface(
    curves: Sequence[ReversalCurve],
    grid: EverettGrid,
    strength: float | None = None,
    where: Mask | None = None,
    terms: int = 0,
) -> FittedSurface:
    """Fit E at the nodes ``where`` (all, if None) by curves that lie around them.

    Without a ``strength`` the penalty has the one that held-out points want. Behind the surface is
    a map of so many ``terms``. Raises InputError where that map does not rise.
    """
    nodes = grid.inside if where is None else grid.inside & where
    thin = [curve.thinned(lambda at: POINTS * grid.place(at)) for curve in curves]
    system = equations(thin, grid)
    if strength is None:
        strength = _best_strength(system, grid, nodes)
    return _solve(system, grid, strength, nodes, terms)


def _best_strength(system: SurfaceEquations, grid: EverettGrid, nodes: Mask) -> float:
    out = np.arange(len(system.outputs)) % HELD_OUT == HELD_OUT // 2
    kept = SurfaceEquations(system.matrix[~out], system.outputs[~out])
    errors = {}
    for strength in STRENGTHS:
        found = _solve(kept, grid, strength, nodes)
        deviation = system.matrix[out] @ found.unknowns - system.outputs[out]
        errors[strength] = float(np.sqrt(np.nanmean(deviation**2)))
    enough = INDISTINCT * min(errors.values())
    return next(strength for strength, error in errors.items() if error <= enough)


def _solve(
    system: SurfaceEquations, grid: EverettGrid, strength: float, nodes: Mask, terms: int = 0
) -> FittedSurface:
    """Solve the normal equations of what lies wholly within the nodes; E is 0 on the diagonal."""
    within = _reaching(system.matrix, nodes)
    outputs = system.outputs[within]
    lower, upper = float(outputs.min()), float(outputs.max())
    bends = sparse.csr_matrix(-map_terms(outputs, lower, upper, terms))
    matrix = sparse.hstack([system.matrix[within][:, _free(nodes)], bends], format="csr")
    rough = _widened(_inner(_third_differences(grid.levels), nodes), terms)
    data = (matrix.T @ matrix).tocsc()
    normal = data + strength * (rough.T @ rough).tocsc()
    solution = solved(normal, matrix.T @ outputs)
    deviation = outputs - matrix @ solution
    noise = np.sqrt(deviation @ deviation / max(len(outputs) - len(solution), 1))
    surface, (offset,), bent = _parts(solution, terms)
    values = _filled(grid, nodes, surface)
    output = OutputMap(lower, upper, bent) if terms else None
    return FittedSurface(grid, values, float(offset), output, float(noise), strength, data, normal)


def _raised(values: Array, least: float) -> Array:
    """Raise what still grows by less than ``least`` to do so; all else stays as it is."""
    raised = values.copy()
    for i in range(1, len(raised)):
        ramp = least * np.arange(i + 1)
        row = np.fmax(raised[i, : i + 1], np.append(raised[i - 1, :i] + least, 0.0))
        row = np.fmax.accumulate((row + ramp)[::-1])[::-1] - ramp
        kept = ~(row > raised[i, : i + 1])
        raised[i, : i + 1] = np.where(kept, raised[i, : i + 1], row)
    return raised


def _parts(solution: Array, terms: int) -> list[Array]:
    """Values at the nodes, the offset alone, and the map's coefficients."""
    return np.split(solution, [len(solution) - terms - 1, len(solution) - terms])


def _widened(rows: sparse.csr_matrix, columns: int) -> sparse.csr_matrix:
    """Return the same rows of so many unknowns more, which have no part in them."""
    nothing = sparse.csr_matrix((rows.shape[0], columns))
    return sparse.hstack([rows, nothing], format="csr")


def _free(nodes: Mask) -> Mask:
    """Unknowns that are fitted: the values at the nodes and the offset."""
    return np.append(nodes.ravel(), True)


def _reaching(rows: sparse.csr_matrix, nodes: Mask) -> Mask:
    """Rows over all unknowns that reach nothing but the nodes, the diagonal and the offset."""
    outside = ~_free(nodes | np.eye(len(nodes), dtype=np.bool_))
    reaching: Mask = abs(rows) @ outside == 0.0
    return reaching


def _inner(rows: sparse.csr_matrix, nodes: Mask) -> sparse.csr_matrix:
    """Return such rows alone, over what is fitted alone."""
    return rows[_reaching(rows, nodes)][:, _free(nodes)]


def _filled(grid: EverettGrid, nodes: Mask, solution: Array) -> Array:
    """Values of a surface, (size, size), those at the nodes from their part of a solution."""
    values = np.where(grid.inside, np.nan, 0.0)
    values[nodes] = solution
    return values


def _third_differences(levels: Array) -> sparse.csr_matrix:
    """Third differences of a surface's values along alpha and along beta; none of the offset.

    Third divided differences times the cube of the levels' mean distance: so smooth is the same
    over a volt wherever the levels are dense.
    """
    size = len(levels)
    scaled = levels * (size - 1) / (levels[-1] - levels[0])
    third = np.zeros((max(size - 3, 0), size))
    for row in range(len(third)):
        near = scaled[row : row + 4]
        apart = near[:, np.newaxis] - near + np.eye(4)
        third[row, row : row + 4] = 6.0 / apart.prod(axis=1)
    third = sparse.csr_matrix(third)
    each = sparse.identity(size)
    both = sparse.vstack([sparse.kron(third, each), sparse.kron(each, third)])
    return sparse.hstack([both, sparse.csr_matrix((both.shape[0], 1))], format="csr")


def _rises(size: int) -> sparse.csr_matrix:
    """First differences of a surface's values with alpha and against beta; none of the offset."""
    first = sparse.csr_matrix(np.diff(np.eye(size), axis=0))
    each = sparse.identity(size)
    both = sparse.vstack([sparse.kron(first, each), -sparse.kron(each, first)])
    return sparse.hstack([both, sparse.csr_matrix((both.shape[0], 1))], format="csr")
