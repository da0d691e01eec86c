"""Normal equations of an image's motion, and how smooth the motion is.

Heights differ from the mean cell by more than noise: each cell has its own faults, and the heights
of one cell share them. So the moments of groups of cells, which would agree but for such faults,
give the variance. The third differences of the splines are normal with a variance of their own,
estimated from the image (empirical Bayes, by the EM algorithm of Dempster, Laird and Rubin 1977):
where no height shows an edge the motion goes on as smoothly as elsewhere.
"""

from collections.abc import Sequence
from typing import TypeAlias

import numpy as np
from attrs import evolve, frozen
from numpy.typing import NDArray

from afm_scan_ros.core.types import Array
from afm_scan_ros.features.images.grating.motion import MotionForm, middles

Indices: TypeAlias = NDArray[np.int64]
GROUPS = 12
"""Groups of cells, of which each shows how much the cells differ."""
APART = 5
"""Groups from one row of cells to the next, so that cells of a group are not neighbours."""
TINY = 1e-12
"""Share of the largest curvature that keeps the equations solvable where nothing is known."""
FIRST = 1e-2
"""Cells; first standard deviation of the third differences, before the image shows it."""


@frozen(eq=False)
class Missed:
    """One direction: positions u, v, residual heights and the cell's slopes, (lines, pixels) each.

    ``weight`` is the inverse variance of a height.
    """

    u: Array
    v: Array
    residual: Array
    slope_u: Array
    slope_v: Array
    weight: Array

    @property
    def steepness(self) -> Array:
        """Square of the slope, per cell."""
        return np.asarray(self.slope_u**2 + self.slope_v**2)

    def scaled(self, noise: float, edges: float) -> "Missed":
        """Weigh by the variances of heights and of edges' places."""
        return evolve(self, weight=1.0 / (noise**2 + edges**2 * self.steepness))

    def information(self, likely: Array) -> Array:
        """Information of each line on u and v, (lines, 2, 2), of heights that count as likely."""
        slopes = np.stack([self.slope_u, self.slope_v])
        return np.asarray(np.einsum("lp,ilp,jlp->lij", likely * self.weight, slopes, slopes))

    def group(self) -> Indices:
        """Group of each pixel's cell."""
        number = (np.floor(self.u) + APART * np.floor(self.v)) % GROUPS
        return np.asarray(number, dtype=np.int64)


@frozen
class Smoothing:
    """Variances of third differences, cells squared: of f in u and v, and of g in u and v."""

    fast: tuple[float, float] = (FIRST**2, FIRST**2)
    slow: tuple[float, float] = (FIRST**2, FIRST**2)

    def precision(self, form: MotionForm) -> Array:
        """Quadratic form of the coefficients of u and v: (2 count, 2 count)."""
        fast, slow = form.roughness()
        blocks = [fast.T @ fast / self.fast[k] + slow.T @ slow / self.slow[k] for k in range(2)]
        zero = np.zeros_like(blocks[0])
        return np.block([[blocks[0], zero], [zero, blocks[1]]])


@frozen(eq=False)
class MotionEquations:
    """Normal equations of the coefficients of u and v: ``gram`` (2 count, 2 count).

    ``moments`` (GROUPS, 2 count) are those of the groups of cells.
    """

    form: MotionForm
    gram: Array
    moments: Array

    @classmethod
    def of(
        cls, form: MotionForm, missed: Sequence[Missed], weights: Sequence[Array]
    ) -> "MotionEquations":
        """Sum over the directions; a height counts its weight over its variance."""
        count = form.count
        gram, moments = np.zeros((2, count, 2, count)), np.zeros((GROUPS, 2, count))
        for direction, (each, likely) in enumerate(zip(missed, weights, strict=True)):
            weight, slopes = likely * each.weight, (each.slope_u, each.slope_v)
            for k, m in ((0, 0), (0, 1), (1, 1)):
                gram[k, :, m] += _gram(form, direction, weight * slopes[k] * slopes[m])
            group = each.group()
            for k in range(2):
                part = weight * slopes[k] * each.residual
                moments[:, k] += _moments(form, direction, group, part)
        gram[1, :, 0] = gram[0, :, 1].T
        return cls(form, gram.reshape(2 * count, 2 * count), moments.reshape(GROUPS, -1))

    @property
    def excess(self) -> float:
        """Variance of the moments over that of independent heights."""
        spread = np.sum((self.moments - self.moments.mean(axis=0)) ** 2) * GROUPS / (GROUPS - 1)
        return max(float(spread / np.trace(self.gram)), 1.0)

    def step(self, coefficients: Array, smoothing: Smoothing) -> tuple[Array, Smoothing]:
        """Change (count, 2) of the coefficients, and the smoothing that they show afterwards."""
        prior = smoothing.precision(self.form)
        covariance = self.covariance(prior)
        moment = self.moments.sum(axis=0) / self.excess - prior @ coefficients.T.ravel()
        step = (covariance @ moment).reshape(2, -1).T
        return step, self._smoothing(coefficients + step, covariance)

    def covariance(self, prior: Array) -> Array:
        """Covariance (2 count, 2 count) of the coefficients beside a prior of that precision."""
        return np.asarray(np.linalg.inv(self._precision(prior)))

    def _precision(self, prior: Array) -> Array:
        whole = self.gram / self.excess + prior
        return np.asarray(whole + TINY * np.abs(whole).max() * np.eye(len(whole)))

    def uncertainty(
        self,
        prior: Array,
        missed: Sequence[Missed],
        weights: Sequence[Array],
        cells: Sequence[Indices],
    ) -> Array:
        """Covariance (2 count, 2 count): of the cells, by a jackknife, and of the prior's bias.

        ``cells`` are the numbers of each direction's cells. The equations are those of the motion
        found, at which the moments balance the prior. The jackknife leaves out each cell in turn,
        so it shows where one cell with a fault alone determines the position of some lines (J. G.
        MacKinnon, M. Ø. Nielsen and M. D. Webb, J. Appl. Econometrics 38, 671, 2023).
        """
        precision, excess = self._precision(prior), self.excess
        covariance = np.linalg.inv(precision)
        total = np.zeros_like(precision)
        every = np.unique(np.concatenate([each.ravel() for each in cells]))
        for cell in every:
            gram, moment = self._of_cell(missed, weights, [each == cell for each in cells])
            change = np.linalg.solve(precision - gram / excess, -moment / excess)
            total += np.outer(change, change)
        return np.asarray(covariance @ prior @ covariance + (1.0 - 1.0 / len(every)) * total)

    def _of_cell(
        self,
        missed: Sequence[Missed],
        weights: Sequence[Array],
        inside: Sequence[NDArray[np.bool_]],
    ) -> tuple[Array, Array]:
        """Equations of the pixels inside a cell: (2 count, 2 count) and (2 count,)."""
        form, size = self.form, 2 * self.form.count
        gram, moment = np.zeros((size, size)), np.zeros(size)
        pixels, lines = middles(form.pixels), middles(form.lines)
        for direction, (each, likely, where) in enumerate(
            zip(missed, weights, inside, strict=True)
        ):
            line, pixel = np.nonzero(where)
            if not line.size:
                continue  # the cell is in view one way only
            rows = form.rows(direction, lines[line], pixels[pixel])
            used = np.flatnonzero(rows.any(axis=0))
            slopes = each.slope_u[where], each.slope_v[where]
            factors = np.hstack([slope[:, np.newaxis] * rows[:, used] for slope in slopes])
            weighed = factors.T * (likely * each.weight)[where]
            both = np.concatenate([used, used + form.count])
            gram[np.ix_(both, both)] += weighed @ factors
            moment[both] += weighed @ each.residual[where]
        return gram, moment

    def _smoothing(self, coefficients: Array, covariance: Array) -> Smoothing:
        """Mean squares of the third differences, those that are not known included."""
        count, found = self.form.count, []
        for differences in self.form.roughness():
            variances = []
            for k in range(2):
                part = covariance[k * count : (k + 1) * count, k * count : (k + 1) * count]
                squares = (differences @ coefficients[:, k]) ** 2
                squares += np.einsum("ij,ij->i", differences @ part, differences)
                variances.append(float(squares.mean()) if len(squares) else 1.0)
            found.append((variances[0], variances[1]))
        return Smoothing(*found)


def _gram(form: MotionForm, direction: int, weight: Array) -> Array:
    """Sum of weight times the products of two factors over an image: (count, count)."""
    pixels, lines = middles(form.pixels), middles(form.lines)
    fast, slow = form.along(direction, pixels), form.across(lines)
    here = form.part(direction)
    there = slice(2 * form.fast, -1)
    result = np.zeros((form.count, form.count))
    result[here, here] = fast.T @ (weight.sum(axis=0)[:, np.newaxis] * fast)
    result[there, there] = slow.T @ (weight.sum(axis=1)[:, np.newaxis] * slow)
    result[here, there] = fast.T @ weight.T @ slow
    result[there, here] = result[here, there].T
    result[here, -1] = result[-1, here] = fast.T @ (pixels * (lines @ weight))
    result[there, -1] = result[-1, there] = slow.T @ (lines * (weight @ pixels))
    result[-1, -1] = lines**2 @ weight @ pixels**2
    return result


def _moments(form: MotionForm, direction: int, group: Indices, weight: Array) -> Array:
    """Sum of weight times a factor over the pixels of each group of an image: (GROUPS, count)."""

    def sums(places: Indices, values: Array, count: int) -> Array:
        index = (group * count + places).ravel()
        found: Array = np.bincount(index, values.ravel(), GROUPS * count).astype(float)
        return found.reshape(GROUPS, count)

    pixels, lines = middles(form.pixels), middles(form.lines)
    line, pixel = np.arange(form.lines)[:, np.newaxis], np.arange(form.pixels)
    here = form.part(direction)
    result = np.zeros((GROUPS, form.count))
    result[:, here] = sums(pixel, weight, form.pixels) @ form.along(direction, pixels)
    result[:, 2 * form.fast : -1] = sums(line, weight, form.lines) @ form.across(lines)
    result[:, -1] = sums(line, weight * pixels, form.lines) @ lines
    return result
