"""A Duhem operator whose slopes are tables of splines, with its sensitivities.

    dw/du = rising(u, w) or falling(u, w) by the direction of u,    A = u + w

``w`` (V) is the distance of the output from the drive, 0 at depolarised rest. The tables hold
coefficients of cubic B-splines on cells of u and of w. Coleman's and Hodgdon's model and Bouc's and
Wen's are of this form, also between memoryless maps, so no map is fitted behind it.
"""

from collections.abc import Iterable, Iterator, Mapping

import numpy as np
from attrs import evolve, frozen
from scipy.interpolate import BSpline

from afm_scan_ros.core.effects.hysteresis.branches import by_input, sensitivities
from afm_scan_ros.core.effects.hysteresis.duhem import DuhemSlopes
from afm_scan_ros.core.fit.settings import DEFAULT_SETTINGS, FitSettings
from afm_scan_ros.core.fit.signals import averaged
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
        along, across = (_third(size) for size in (rows, columns))
        rough = np.kron(along, np.eye(columns)) + np.kron(np.eye(rows), across)
        bent = rough / scales["slopes"] ** 2 + np.eye(len(rough)) / self.settings.slopes**2
        return np.asarray(np.kron(np.eye(2), bent))

    def output(self, theta: Array, drive: Array, *, rested: bool) -> Array:
        """A (V) for a drive (V), both (n,)."""
        now = np.array([0.0 if rested else drive[0], 0.0])
        count = self.settings.slope_cells_drive
        line = np.ones(count + 3), np.linspace(self.lower, self.upper, count + 1)
        return by_input(theta.reshape(self.shape), line, self.cells, now, drive)

    def pieces(self, theta: Array, drive: Array, block: int, *, rested: bool) -> Iterator[Array]:
        """Yield ∂A/∂theta for the mean drive of blocks, in pieces of shape (blocks, parameters)."""
        path = averaged(drive, block)
        now, grown = np.array([0.0 if rested else drive[0], 0.0]), self.unbent()
        at_once = self.settings.blocks_at_once
        tables, open_end = theta.reshape(self.shape), np.full(at_once, np.nan)
        for first in range(0, len(path), at_once):
            part = path[first : first + at_once]
            yield sensitivities(tables, self.cells, now, grown, part, open_end)[1]

    def started(self, paths: Iterable[tuple[Array, Array]]) -> list[Array]:
        """Slopes that lead from each sample of drive and A (V) to the next, ever smoother ones.

        Paths that no such operator makes give slopes that lead astray unless they are smooth. So
        the last have no hysteresis, and none exceeds what is expected of a slope.
        """
        matrix, right = np.zeros((self.parts["slopes"],) * 2), self.unbent()
        at_once = self.settings.blocks_at_once
        for drive, output in paths:
            w = output - drive
            for first in range(0, len(drive) - 1, at_once):
                part = slice(first + 1, first + at_once + 1)
                now, grown = np.array([drive[first], w[first]]), self.unbent()
                flat = self.unbent().reshape(self.shape)
                jacobian = sensitivities(flat, self.cells, now, grown, drive[part], w[part])[1]
                matrix += jacobian.T @ jacobian
                right += jacobian.T @ np.diff(w[first : first + at_once + 1])
        prior = self.precision("slopes", {"slopes": 0.1 * self.settings.slopes})
        prior *= np.trace(matrix) / np.trace(prior)
        strengths = np.logspace(-12.0, 0.0, 9)
        found = [np.linalg.solve(matrix + one * prior, right) for one in strengths]
        ends = self.lowest, self.settings.slopes
        return [*(np.clip(one, *ends) for one in found), self.unbent()]

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

    def slopes(self, theta: Array) -> DuhemSlopes:
        """Return the effect's parameters."""
        rising, falling = 1.0 + theta.reshape(self.shape)
        slope = np.ones(self.settings.slope_cells_drive + 3)
        ends = self.lower, self.upper
        return DuhemSlopes(*ends, self.lower, 0.0, self.widths, slope, rising, falling)


def _third(size: int) -> Array:
    third = np.diff(np.eye(size), n=3, axis=0)
    return np.asarray(third.T @ third)
