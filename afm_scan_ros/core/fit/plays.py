"""A Preisach operator as plays, linear in its weights: the regressors of the hysteresis.

    P(u) = Σ_r T_r(p_r(u)),    p_r(t) = min(u + r, max(u - r, p_r(t - 1)))

``p_r`` is the play of threshold r (V), p_0 = u. ``T_r`` is a straight line of slope w_r, and a
correction that lets the density vary along the other axis of the Preisach plane:

    T_r'(p) = Δ_r (d_r + Σ_j c_j(r) b_j(p)),

with the widths Δ_r of the grid of thresholds over the half range, the density d_r, and quadratic
B-splines b_j of the play's position, whose coefficients c_j(r) are linear between a few thresholds.
T_r is zero in the middle of a range that is not about 0 V, or where a play stays that the range
cannot push both ways, and the middle is added to T_0, so that P(u) lies about u in any range.
Source: M. Brokate and J. Sprekels, Hysteresis and Phase Transitions, Springer 1996, 2.3 and 2.4.
"""

from collections.abc import Iterator, Mapping
from functools import cached_property

import numpy as np
from attrs import field, frozen
from numpy.typing import NDArray
from scipy.interpolate import BSpline
from scipy.linalg import block_diag

from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.fit.settings import DEFAULT_SETTINGS, FitSettings
from afm_scan_ros.core.fit.stretches import Edges
from afm_scan_ros.core.types import Array


@frozen(eq=False)
class Plays:
    """Plays over a drive between ``lower`` and ``upper`` (V)."""

    lower: float = field(converter=float)
    upper: float = field(converter=float)
    settings: FitSettings = DEFAULT_SETTINGS
    linear = True
    lowest = -np.inf

    @property
    def half(self) -> float:
        """Half the drive's range, V."""
        return 0.5 * (self.upper - self.lower)

    @property
    def bends(self) -> int:
        """Coefficients of the map behind the plays."""
        return self.settings.map_terms

    @property
    def deepest(self) -> float:
        """Largest threshold that the drive moves from depolarised rest at 0 V, over half the range.

        One above 1 moves once, and is no part of the model between ``lower`` and ``upper``.
        """
        return max(abs(self.lower), abs(self.upper), self.half) / self.half

    @cached_property
    def thresholds(self) -> Array:
        """Thresholds r (V), shape (plays,); the first is 0: the drive itself."""
        s, step = self.settings, self.settings.play_step
        small = np.geomspace(s.smallest_play, 2.0 * step, s.small_plays)
        large = np.arange(3.0 * step, self.deepest - 0.5 * step, step)
        return self.half * np.concatenate([[0.0], small, large])

    @cached_property
    def widths(self) -> Array:
        """Share of the half range that each threshold stands for, shape (plays,); 1 for r = 0."""
        share = self.thresholds / self.half
        edges = np.concatenate([[0.0], 0.5 * (share[2:] + share[1:-1]), [self.deepest]])
        return np.asarray(np.concatenate([[1.0], np.diff(edges)]))

    @cached_property
    def blend(self) -> Array:
        """Hats of the coarse thresholds at each threshold, shape (plays, coarse).

        They are denser towards small thresholds, as the density varies most there.
        """
        coarse = self.deepest * np.linspace(0.0, 1.0, self.settings.correction_plays) ** 1.5
        share = self.thresholds / self.half
        hats = [np.interp(share, coarse, one) for one in np.eye(len(coarse))]
        return np.asarray(np.column_stack(hats))

    @cached_property
    def positions(self) -> Array:
        """Positions of a play (V) at which T_r is tabulated, shape (table,): 64 in each cell."""
        return np.linspace(self.lower, self.upper, 64 * self.settings.correction_cells + 1)

    @cached_property
    def knots(self) -> Array:
        """Knots of the B-splines b_j, V."""
        cells = self.settings.correction_cells
        return self.lower + 2.0 * self.half / cells * np.arange(-2.0, cells + 3.0)

    @cached_property
    def origins(self) -> Array:
        """Positions of plays (V) at which T_r is zero, shape (plays,).

        In a range about 0 V, where no play moves once, that is rest.
        """
        once = self.thresholds > self.half
        middle = 0.5 * (self.lower + self.upper) if once.any() else 0.0
        return np.where(once, self.settled, middle)

    @cached_property
    def risen(self) -> Array:
        """Rises of the B-splines at the origins, V, (plays, splines); none in the middle."""
        places = (self.origins - self.lower) / (self.positions[1] - self.positions[0])
        cells = np.clip(places.astype(int), 0, len(self.positions) - 2)
        before, after = self.rises[:, cells], self.rises[:, cells + 1]
        values = before + (places - cells) * (after - before)
        return np.where(self.thresholds > self.half, values, 0.0).T

    @cached_property
    def rises(self) -> Array:
        """Integrals of the B-splines over the position from the middle, V, (splines, table)."""
        risen = self._splines.antiderivative()
        return np.asarray((risen(self.positions) - risen(0.5 * (self.lower + self.upper))).T)

    @cached_property
    def _bent(self) -> Array:
        """Second derivatives of the rises, 1/V, (splines, table)."""
        return np.asarray(self._splines.derivative()(self.positions).T)

    @property
    def _splines(self) -> BSpline:
        return BSpline(self.knots, np.eye(len(self.knots) - 3), 2)

    @cached_property
    def reached(self) -> NDArray[np.bool_]:
        """Which splines some play about each coarse threshold reaches, shape (coarse, splines)."""
        nearest = self.thresholds[np.argmax(self.blend > 0.0, axis=0), np.newaxis]
        lowest = np.minimum(0.0, self.lower + nearest)
        highest = np.maximum(0.0, self.upper - nearest)
        return np.asarray((self.knots[3:] > lowest) & (self.knots[:-3] < highest))

    @property
    def parts(self) -> dict[str, int]:
        """Number of parameters of each group."""
        return {"density": len(self.thresholds), "correction": int(self.reached.sum())}

    def unbent(self) -> Array:
        """Weights of no hysteresis, F = u."""
        return np.asarray(np.eye(sum(self.parts.values()))[0])

    def precision(self, name: str, scales: Mapping[str, float]) -> Array:
        """Precision of the prior of a group.

        The density is smooth in the logarithm of the threshold, with a rough part; that of the
        drive itself, the first, is nearly free. That of plays which move once, from rest, is not
        foretold by the others: where no record began at rest, it is none.
        """
        if name == "correction":
            return self._smooth_correction / scales["correction"] ** 2
        often = self.thresholds[1:] <= self.half
        parts = [
            self._smooth_density(np.log(self.thresholds[1:][some]), scales)
            for some in (often, ~often)
            if some.any()
        ]
        return np.asarray(block_diag(1.0, *parts))

    def _smooth_density(self, places: Array, scales: Mapping[str, float]) -> Array:
        """Precision of a density that is smooth over places, (plays,), but for its rough part."""
        plays = np.eye(len(places))
        bent = _bends(places)
        smooth = bent.T @ bent / scales["smooth_density"] ** 2 + plays / self.settings.density**2
        rough = scales["rough_density"] ** 2 * plays
        return np.asarray(np.linalg.inv(np.linalg.inv(smooth) + rough))

    @cached_property
    def _smooth_correction(self) -> Array:
        """Precision of the correction's coefficients, those that no play reaches being free."""
        rows, columns = self.reached.shape
        along, across = (np.diff(np.eye(size), 2, axis=0) for size in (rows, columns))
        bent = np.kron(along.T @ along, np.eye(columns))
        bent += np.kron(np.eye(rows), across.T @ across)
        covariance = np.linalg.inv(bent + 0.05 * np.eye(len(bent)))
        some = np.flatnonzero(self.reached)
        return np.asarray(np.linalg.inv(covariance[np.ix_(some, some)]))

    @cached_property
    def settled(self) -> Array:
        """Plays (V) after a first drive from depolarised rest to both ends of the range.

        Those of thresholds above half the range stay there ever after. For the others, which any
        such drive writes anew, the value is that of rest.
        """
        pushed = np.clip(0.0, self.upper - self.thresholds, self.lower + self.thresholds)
        return np.where(self.thresholds > self.half, pushed, 0.0)

    @cached_property
    def _hats(self) -> Array:
        """Hats over the threshold by which the plays of an unknown start lie, (plays, unknowns)."""
        count = self.unknowns
        places = self.half * np.arange(count + 1.0) / count
        each = [np.interp(self.thresholds, places, one) for one in np.eye(count + 1)[1:]]
        return np.where(self.thresholds > self.half, 0.0, np.array(each)).T

    @property
    def unknowns(self) -> int:
        """Number of values that say where the plays lie at an unknown start."""
        return self.settings.memory_values

    def expected_memory(self) -> Array:
        """Standard deviation of these values (V): a play is anywhere within its threshold."""
        shares = np.arange(1.0, self.unknowns + 1.0) / self.unknowns
        return np.asarray(self.half / np.sqrt(3.0) * shares)

    rests = 1
    """Number of values that say where the plays lie at depolarised rest."""

    def expected_rest(self) -> Array:
        """Standard deviation of the value that gives the bias of depolarised rest, V, (1,)."""
        return np.array([self.settings.rest_bias * self.half])

    def bias(self, rest: Array) -> tuple[float, float]:
        """Bias of depolarised rest (V) for its value in θ (V), (1,), and the derivative by that.

        It stays within ``rest_bias`` of half the range.
        """
        most = self.settings.rest_bias * self.half
        share = float(np.tanh(rest[0] / most))
        return most * share, 1.0 - share**2

    def at_rest(self, rest: Array) -> tuple[Array, Array]:
        """Plays (V) of a depolarised scanner, and their derivatives by ``rest``, (plays, 1).

        Each rests in the middle of an oscillation as large as its threshold. A map before the
        hysteresis moves that middle by the square of the amplitude, and by the bias (V) that of one
        as large as half the range.
        """
        (bias, slope), moved = self.bias(rest), np.square(self.thresholds / self.half)
        limits = np.where(self.thresholds > self.half, 0.0, self.thresholds)
        inside = np.abs(moved * bias) < limits
        changes = slope * (moved * inside)[:, np.newaxis]
        return np.clip(moved * bias, -limits, limits), changes

    def depolarised(self, _theta: Array) -> Array:
        """Return a value for ``at_rest``, (1,): no bias, where no record began at rest."""
        return np.zeros(1)

    def in_use(self, drive: float, memory: Array) -> tuple[Array, Array]:
        """Plays (V) of a scanner in use, and their derivatives by its memory, (plays, unknowns).

        It has been at both ends of the range. How far its plays then lie from the ``drive`` (V) is
        its ``memory`` (V), linear between a few thresholds, and none at depolarised rest.
        """
        apart = self._hats @ memory
        inside = np.abs(apart) < self.thresholds
        plays = float(drive) + np.clip(apart, -self.thresholds, self.thresholds)
        start = np.where(self.thresholds > self.half, self.settled, plays)
        return start, self._hats * inside[:, np.newaxis]

    def remembered(
        self, theta: Array, drive: Array, edges: Edges, start: tuple[Array, Array]
    ) -> Array:
        """∂P/∂memory averaged over stretches, (stretches, unknowns): of plays that never moved.

        ``start`` holds the plays before the drive, and their derivatives.
        """
        (plays, changes), tables, count = start, self.tables(theta), len(edges) - 1
        slopes = [
            np.interp(at, self.positions, each)
            for at, each in zip(plays, np.gradient(tables, self.positions, axis=1), strict=True)
        ]
        each = changes * np.array(slopes)[:, np.newaxis]
        highest, lowest = np.maximum.accumulate(drive), -np.minimum.accumulate(drive)
        moved = np.minimum(
            np.searchsorted(highest, plays + self.thresholds, "right"),
            np.searchsorted(lowest, self.thresholds - plays, "right"),
        )
        lost, place = np.zeros((count + 1, each.shape[1])), np.searchsorted(edges, moved, "right")
        at, ends = np.minimum(place - 1, count), np.append(edges, edges[-1] + 1)
        late = ((moved - ends[at]) / np.diff(ends)[at])[:, np.newaxis] * each
        np.add.at(lost, at, each - late)
        np.add.at(lost, np.minimum(at + 1, count), late)
        return np.asarray(each.sum(axis=0) - np.cumsum(lost, axis=0)[:count])

    def weights(self, theta: Array) -> tuple[Array, Array]:
        """Density d_r, shape (plays,), and the correction's Σ_j c_j(r) b_j as (plays, splines)."""
        density, correction = theta[: len(self.thresholds)], np.zeros(self.reached.shape)
        correction[self.reached] = theta[len(self.thresholds) :]
        return density, self.blend @ correction

    def tables(self, theta: Array) -> Array:
        """T_r at the positions, shape (plays, table)."""
        density, correction = self.weights(theta)
        along = density[:, np.newaxis] * (self.positions - self.origins[:, np.newaxis])
        along += correction @ self.rises - np.sum(correction * self.risen, axis=1)[:, np.newaxis]
        along *= self.widths[:, np.newaxis]
        along[0] += self.origins[0]
        return np.asarray(along)

    def output(self, theta: Array, drive: Array, start: Array) -> Array:
        """P(u) in V for a drive u (V), both (n,), after plays (V) at the ``start``, (plays,)."""
        scale = (len(self.positions) - 1) / (self.upper - self.lower)
        tables = self.tables(theta)
        return _output(drive, self.thresholds, start.copy(), tables, self.lower, scale)

    def pieces(
        self, _: Array, drive: Array, edges: Edges, start: Array
    ) -> Iterator[NDArray[np.float32]]:
        """Yield ∂P/∂theta averaged over stretches, in pieces of shape (stretches, parameters).

        In single precision: there may be gigabytes of them, and only steps are made of them.
        """
        both = _moments(drive, self.thresholds, start.copy(), edges)
        at_once = self.settings.rows_at_once
        for first in range(0, len(edges) - 1, at_once):
            yield self._columns(*(one[first : first + at_once] for one in both))

    def _columns(self, plays: Array, variances: Array) -> NDArray[np.float32]:
        """∂P/∂theta of plays (V) that vary by so much (V²) about their means, (stretches, plays).

        The mean of a rise is that at the mean and half the variance times its second derivative.
        """
        result = np.empty((len(plays), sum(self.parts.values())), np.float32)
        count = len(self.thresholds)
        result[:, :count] = (plays - self.origins) * self.widths
        place = np.cumsum(self.reached).reshape(self.reached.shape) - 1
        place[~self.reached] = -1
        _correct(
            result[:, count:],
            (plays - self.lower) * (len(self.positions) - 1) / (self.upper - self.lower),
            0.5 * variances,
            (self.rises.T.copy(), self._bent.T.copy(), self.risen),
            self.widths[:, np.newaxis] * self.blend,
            place,
        )
        return result

    @cached_property
    def _branches(self) -> tuple[Array, NDArray[np.bool_]]:
        """Splines at u - r and at u + r at levels u of the range, (2, levels, plays, splines).

        The second value is whether a play can have been pushed back before, (2, levels, plays).
        """
        levels = np.linspace(self.lower, self.upper, self.settings.surface_levels)
        thresholds = self.thresholds[self.thresholds <= self.half]
        ways = np.array([-1.0, 1.0])[:, np.newaxis, np.newaxis]
        places = levels[:, np.newaxis] + ways * thresholds
        inside = np.clip(places, self.knots[2], self.knots[-3]).ravel()
        splines = BSpline.design_matrix(inside, self.knots, 2).toarray().reshape(*places.shape, -1)
        rises = np.array([levels - self.lower, self.upper - levels])
        return splines, np.asarray(2.0 * thresholds <= rises[:, :, np.newaxis])

    def lacking(self, theta: Array) -> tuple[Array, Array]:
        """Least S at each level where it is too small, as linear conditions on the weights.

        Once a drive u has turned, the plays up to some threshold R follow it, and A changes by

            S(u, R) = Σ_{r ≤ R} T_r'(u ∓ r)    for each volt of a rise or a fall.

        Only a surface on which it is ``least_slope`` at least has an inverse. Returns the rows of
        the conditions, shape (conditions, weights), and by how much each lacks, both over the
        settings' ``slope_tolerance``: what lacks changes by minus the rows times a change of theta.
        """
        (splines, follows), settings = self._branches, self.settings
        count = follows.shape[2]
        widths, blend = self.widths[:count], self.blend[:count]
        density, correction = (each[:count] for each in self.weights(theta))
        along = np.einsum("dlrs,rs->dlr", splines, correction)
        slopes = np.cumsum(widths * (density + along), axis=2)
        slopes[~follows] = np.inf
        last, least = np.argmin(slopes, axis=2), slopes.min(axis=2)
        places = np.argwhere(least < settings.least_slope)
        rows = np.zeros((len(places), len(theta)))
        for row, (way, level) in zip(rows, places, strict=True):
            upto = slice(last[way, level] + 1)
            row[upto] = widths[upto]
            mixed = (widths[upto, np.newaxis] * blend[upto]).T @ splines[way, level, upto]
            row[len(self.thresholds) :] = mixed[self.reached]
        lacks = settings.least_slope - least[tuple(places.T)]
        return rows / settings.slope_tolerance, lacks / settings.slope_tolerance


@compiled
def _output(
    drive: Array, thresholds: Array, plays: Array, tables: Array, lower: float, scale: float
) -> Array:
    """Sum of the tables at all plays, (n,).

    Where neighbours lie no farther apart than their thresholds, as after any drive, a play that
    stays shows that all of larger thresholds stay.
    """
    result = np.empty(drive.size)
    last = tables.shape[1] - 2
    kept = np.zeros(plays.size)
    total = 0.0
    nested = np.all(np.abs(np.diff(plays)) <= np.diff(thresholds) * (1.0 + 1e-12))
    for k in range(drive.size):
        u = drive[k]
        for i in range(plays.size):
            p = min(u + thresholds[i], max(u - thresholds[i], plays[i]))
            if k == 0 or p != plays[i]:
                plays[i] = p
                place = (p - lower) * scale
                cell = min(max(int(place), 0), last)
                value = tables[i, cell] + (place - cell) * (tables[i, cell + 1] - tables[i, cell])
                total += value - kept[i]
                kept[i] = value
            elif nested:
                break
        result[k] = total
    return result


@compiled
def _correct(
    result: NDArray[np.float32],
    cells: Array,
    variances: Array,
    tables: tuple[Array, Array, Array],
    mixing: Array,
    place: NDArray[np.intp],
) -> None:
    """Derivatives by the correction, whose coefficients have a ``place``, (coarse, splines), or -1.

    ``cells`` are plays in cells of the ``tables`` of the rises and of their second derivatives,
    (table, splines), of which the last holds the rises at the origins, (plays, splines); ``mixing``
    is the share of each coarse threshold, (plays, coarse).
    """
    rises, bends, risen = tables
    last = rises.shape[0] - 2
    for k in range(cells.shape[0]):
        total = np.zeros(result.shape[1])
        for i in range(cells.shape[1]):
            cell = min(max(int(cells[k, i]), 0), last)
            part, half = cells[k, i] - cell, variances[k, i]
            for c in range(mixing.shape[1]):
                share = mixing[i, c]
                if share == 0.0:
                    continue
                for j in range(rises.shape[1]):
                    if place[c, j] >= 0:
                        value = rises[cell, j] + part * (rises[cell + 1, j] - rises[cell, j])
                        value -= risen[i, j]
                        value += half * (
                            bends[cell, j] + part * (bends[cell + 1, j] - bends[cell, j])
                        )
                        total[place[c, j]] += share * value
        result[k] = total


@compiled
def _moments(drive: Array, thresholds: Array, plays: Array, edges: Edges) -> tuple[Array, Array]:
    """Means and variances of plays over stretches, both (stretches, plays)."""
    mean = np.zeros((edges.size - 1, plays.size))
    variance = np.zeros((edges.size - 1, plays.size))
    for k in range(edges.size - 1):
        before, count = plays.copy(), edges[k + 1] - edges[k]
        for j in range(edges[k], edges[k + 1]):
            u = drive[j]
            for i in range(plays.size):
                plays[i] = min(u + thresholds[i], max(u - thresholds[i], plays[i]))
                moved = plays[i] - before[i]
                mean[k, i] += moved
                variance[k, i] += moved * moved
        for i in range(plays.size):
            mean[k, i] /= count
            variance[k, i] = max(variance[k, i] / count - mean[k, i] ** 2, 0.0)
            mean[k, i] += before[i]
    return mean, variance


def _bends(places: Array) -> Array:
    """Second differences over uneven places, shape (n - 2, n), per unit of the mean distance."""
    unit = (places[-1] - places[0]) / max(len(places) - 1, 1)
    result = np.zeros((max(len(places) - 2, 0), len(places)))
    for i in range(len(result)):
        before, after = np.diff(places[i : i + 3]) / unit
        bend = np.array([1.0 / before, -1.0 / before - 1.0 / after, 1.0 / after])
        result[i, i : i + 3] = 2.0 / (before + after) * bend
    return result
