"""A Duhem operator whose slopes are tables of splines, with its sensitivities.

    dw/du = rising(u, w) or falling(u, w) by the direction of u,    A = u + w

``w`` (V) is the distance of the output from the drive, 0 at depolarised rest. The tables hold
coefficients of cubic B-splines on cells of u and of w. Coleman's and Hodgdon's model and Bouc's and
Wen's are of this form, also between memoryless maps, so no map is fitted behind it.
"""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from attrs import evolve, frozen
from scipy.interpolate import BSpline

from afm_scan_ros.core.effects.hysteresis.branches import (
    STOPS,
    by_input,
    mean_sensitivities,
    sensitivities,
)
from afm_scan_ros.core.effects.hysteresis.duhem import DuhemSlopes
from afm_scan_ros.core.fit.settings import DEFAULT_SETTINGS, FitSettings
from afm_scan_ros.core.fit.stretches import Edges, means
from afm_scan_ros.core.types import Array


@frozen(eq=False)
class OneState:
    """Slopes over a drive from ``lower`` to ``upper`` and w between both ``widths``, V.

    No map is fitted behind it, which such an operator contains.
    """

    lower: float
    upper: float
    widths: tuple[float, float]
    settings: FitSettings = DEFAULT_SETTINGS
    bends = 0
    linear = False

    @property
    def half(self) -> float:
        """Half the drive's range, V."""
        return 0.5 * (self.upper - self.lower)

    @property
    def lowest(self) -> float:
        """Least dw/du, so that the output grows with the drive and the operator has an inverse."""
        return self.settings.least_slope - 1.0

    @property
    def shape(self) -> tuple[int, int, int]:
        """Shape of both tables together."""
        return 2, self.settings.slope_cells_drive + 3, self.settings.slope_cells_state + 3

    @property
    def parts(self) -> dict[str, int]:
        """Number of parameters."""
        return {"slopes": int(np.prod(self.shape))}

    @property
    def cells(self) -> tuple[float, float, float, float]:
        """Lowest u and its cell, lowest w and its cell, V."""
        wide = (self.upper - self.lower) / self.settings.slope_cells_drive
        low, high = self.widths
        return self.lower, wide, low, (high - low) / self.settings.slope_cells_state

    def unbent(self) -> Array:
        """Slopes of no hysteresis."""
        return np.zeros(self.parts["slopes"])

    def precision(self, _name: str, scales: Mapping[str, float]) -> Array:
        """Third differences along both sides are small, and all slopes of order one."""
        rows, columns = self.shape[1:]
        thirds = (np.diff(np.eye(size), n=3, axis=0) for size in (rows, columns))
        along, across = (each.T @ each for each in thirds)
        rough = np.kron(along, np.eye(columns)) + np.kron(np.eye(rows), across)
        bent = rough / scales["slopes"] ** 2 + np.eye(len(rough)) / self.settings.slopes**2
        return np.asarray(np.kron(np.eye(2), bent))

    unknowns = 1

    def expected_memory(self) -> Array:
        """Standard deviation of w (V) at an unknown start: anywhere between both ``widths``."""
        return np.array([(self.widths[1] - self.widths[0]) / np.sqrt(12.0)])

    rests = 1
    """Number of values that say where w lies at depolarised rest."""

    def expected_rest(self) -> Array:
        """Standard deviation of w (V) at depolarised rest, (1,): what is 0 there is a convention.

        Where no record began at rest, any w may be added to that of all records.
        """
        return self.expected_memory()

    def at_rest(self, rest: Array) -> tuple[Array, Array]:
        """Drive and w (V) at depolarised rest, (2,), and the derivatives by that w, (2, 1)."""
        return self.in_use(0.0, rest)

    def depolarised(self, theta: Array) -> Array:
        """W (V) at 0 V after the drive has alternated ever less, (1,): a value for ``at_rest``.

        From the ends of the range on, to which the turns keep.
        """
        count = self.settings.direct_levels
        sizes = np.linspace(max(-self.lower, self.upper), 0.0, count)
        turns = np.clip(sizes * (-1.0) ** np.arange(count), self.lower, self.upper)
        drive = np.interp(np.arange(count**2) / count, np.arange(count), turns)
        return self.output(theta, np.append(drive, 0.0), np.zeros(2))[-1:]

    def in_use(self, drive: float, memory: Array) -> tuple[Array, Array]:
        """Drive and w (V), (2,), of a scanner in use, and the derivatives by its memory, (2, 1)."""
        return np.append(drive, memory), np.array([[0.0], [1.0]])

    def output(self, theta: Array, drive: Array, start: Array) -> Array:
        """A (V) for a drive (V), both (n,), after drive and w (V) at the ``start``, (2,)."""
        count = self.settings.slope_cells_drive
        line = np.ones(count + 3), np.linspace(self.lower, self.upper, count + 1)
        return by_input(theta.reshape(self.shape), line, self.cells, start.copy(), drive)

    def remembered(
        self, theta: Array, drive: Array, edges: Edges, start: tuple[Array, Array]
    ) -> Array:
        """∂A/∂memory averaged over stretches, (stretches, unknowns), by differences."""
        apart, (now, changes) = np.sqrt(np.finfo(float).eps) * self.half, start
        result = np.zeros((len(edges) - 1, changes.shape[1]))
        for k, change in enumerate(changes.T):
            ends = (self.output(theta, drive, now + way * apart * change) for way in (1.0, -1.0))
            up, down = (means(one, edges) for one in ends)
            result[:, k] = (up - down) / (2.0 * apart)
        return result

    def pieces(self, theta: Array, drive: Array, edges: Edges, start: Array) -> Iterator[Array]:
        """Yield ∂A/∂theta averaged over stretches, in pieces of shape (stretches, parameters)."""
        now, grown = start.copy(), self.unbent()
        tables, at_once = theta.reshape(self.shape), self.settings.rows_at_once
        for first in range(0, len(edges) - 1, at_once):
            part = edges[first : first + at_once + 1]
            yield mean_sensitivities(tables, self.cells, now, grown, drive, part)

    def started(self, paths: Sequence[tuple[Array, Array]]) -> Array:
        """Slopes that follow paths of drive and A (V) best, from an ever weaker prior on.

        The first lead from each sample to the next, which is nearly linear in them, the others
        along the whole paths. Where none follows, there is no hysteresis. The operator knows no
        time, so that between the turns of a drive few samples do.
        """
        thin = [self._thinned(*path) for path in paths]
        prior = self.precision("slopes", {"slopes": 0.1 * self.settings.slopes})
        theta, normal = self.unbent(), self._stepped(thin, self.unbent(), whole=False)
        best, least = theta, self._stepped(thin, theta)[2]
        for strength in np.logspace(0.0, -3.0, self.settings.start_strengths):
            for _ in range(self.settings.start_rounds):
                matrix, right, _ = normal
                weight = strength * max(np.trace(matrix), np.finfo(float).tiny) / np.trace(prior)
                theta = np.linalg.lstsq(matrix + weight * prior, right, rcond=None)[0]
                theta = np.clip(theta, self.lowest, self.settings.slopes)
                normal = self._stepped(thin, theta)
                if normal[2] < least:
                    best, least = theta, normal[2]
        return best

    def _thinned(self, drive: Array, output: Array) -> tuple[Array, Array]:
        """Leave of a path its turns, its ends, and the first samples behind stops of branches."""
        ways, stops = np.sign(np.diff(drive)), np.floor(STOPS * drive / self.cells[1])
        kept = np.ones(len(drive), bool)
        kept[1:-1] = (ways[1:] != ways[:-1]) | (stops[1:-1] != stops[:-2])
        return drive[kept], output[kept]

    def _stepped(
        self, paths: Sequence[tuple[Array, Array]], theta: Array, *, whole: bool = True
    ) -> tuple[Array, Array, float]:
        """Normal equations for slopes that follow whole paths, linearised at some; their misfit.

        Or else those that lead from each sample of the paths to the next.
        """
        matrix, right, misfit = np.zeros((self.parts["slopes"],) * 2), self.unbent(), 0.0
        at_once = self.settings.rows_at_once
        for drive, output in paths:
            w = output - drive
            known = np.full(len(w), np.nan) if whole else w
            now, grown = np.array([drive[0], w[0]]), self.unbent()
            for first in range(1, len(drive), at_once):
                part = slice(first, first + at_once)
                given = theta.reshape(self.shape), self.cells, now, grown
                reached, jacobian = sensitivities(*given, drive[part], known[part])
                live = np.flatnonzero(jacobian.any(axis=0))
                columns, left = jacobian[:, live], w[part] - reached
                matrix[np.ix_(live, live)] += columns.T @ columns
                right[live] += columns.T @ (left + columns @ theta[live])
                misfit += float(left @ left)
        return matrix, right, misfit

    def covering(self, theta: Array, states: Array) -> tuple["OneState", Array]:
        """Return the same slopes on cells that reach just beyond all states w (V).

        Beyond its cells a table continues with the values of its edge.
        """
        low, high = float(states.min()), float(states.max())
        margin = self.settings.state_margin * (high - low)
        inside = self.widths[0] <= low and high <= self.widths[1]
        if inside and self.widths[1] - self.widths[0] <= high - low + 6.0 * margin:
            return self, theta
        other = evolve(self, widths=(low - margin, high + margin))
        places = np.linspace(*other.widths, 4 * self.settings.slope_cells_state + 1)
        old, new = (each.across(places) for each in (self, other))
        moved = theta.reshape(self.shape) @ np.linalg.lstsq(new, old, rcond=None)[0].T
        return other, np.clip(moved, self.lowest, None).ravel()

    def across(self, states: Array) -> Array:
        """Values of the splines over w at states (V), (n,), shape (n, splines)."""
        _, _, low, cell = self.cells
        count = self.settings.slope_cells_state
        knots = low + cell * np.arange(-3.0, count + 4.0)
        inside = np.clip(states, knots[3], knots[count + 3])
        return np.asarray(BSpline.design_matrix(inside, knots, 3).toarray())

    def lacking(self, theta: Array) -> tuple[Array, Array]:
        """Slopes by which a path leaves the cells, where it does, as linear conditions on theta.

        At the highest w a path rises at most as steeply as the drive and falls at least so, at the
        lowest the other way round. Records that never go there tell nothing of these slopes, and w
        would run away. Returns what ``Plays.lacking`` does.
        """
        tables, found, lacks = theta.reshape(self.shape), [], []
        for table, splines in enumerate(self._leaving()):
            beyond = tables[table] @ splines.T
            for row, edge in np.argwhere(beyond > 0.0):
                condition = np.zeros(self.shape)
                condition[table, row] = -splines[edge]
                found.append(condition.ravel())
                lacks.append(beyond[row, edge])
        tolerance = self.settings.slope_tolerance
        return np.array(found).reshape(-1, theta.size) / tolerance, np.array(lacks) / tolerance

    def _leaving(self) -> Array:
        """Weights of the splines in how fast w leaves its lowest and its highest value.

        Shape (2, 2, splines): while the drive rises and while it falls.
        """
        lowest, highest = self.across(np.array(self.widths))
        return np.array([[-lowest, highest], [lowest, -highest]])

    def slopes(self, theta: Array, rest: Array) -> DuhemSlopes:
        """Return the effect's parameters, for w (V) at depolarised rest, (1,), where F is 0.

        Where a path would leave the cells, their outermost slopes end at the drive's.
        """
        tables = 1.0 + theta.reshape(self.shape)
        for slopes, leaving in zip(tables, self._leaving(), strict=True):
            for splines in leaving:
                way, places = np.sign(splines.sum()), np.flatnonzero(splines)
                rows = np.flatnonzero((slopes - 1.0) @ splines > self.settings.slope_tolerance)
                outer = np.ix_(rows, places)
                slopes[outer] = 1.0 + way * np.minimum(way * (slopes[outer] - 1.0), 0.0)
        rising, falling = tables
        slope = np.ones(self.settings.slope_cells_drive + 3)
        ends = self.lower, self.upper
        offset = self.lower - float(rest[0])
        return DuhemSlopes(*ends, offset, 0.0, self.widths, slope, rising, falling)
