"""Hysteresis by Duhem's model: the output alone is what the material remembers.

    dF/du = rising(u, F) while the input u grows,    dF/du = falling(u, F) while it falls

with inputs u and outputs F in V. Coleman's and Hodgdon's model and Bouc's and Wen's are of this
form, also between memoryless maps that rise. Minor loops drift, and no extremum wipes out another:
so it is no Preisach operator. Both slopes are positive, so that the inverse is the same equation,
du/dF = 1 / slope. Each slope is a tensor product of cubic B-splines in u and in the distance of F
from a centre curve.
Source: B. D. Coleman and M. L. Hodgdon, Int. J. Engineering Science 24 (1986) 897, Eq. 2.1; M.
Ismail, F. Ikhouane and J. Rodellar, Arch. Comput. Methods Eng. 16 (2009) 161, Eqs. 1 to 3.
"""

import numpy as np
from attrs import evolve, field, frozen

from afm_scan_ros.core.effects.base import CausalInverse
from afm_scan_ros.core.effects.hysteresis.branches import (
    Centre,
    Grid,
    by_input,
    by_output,
    heights,
)
from afm_scan_ros.core.effects.hysteresis.everett import BeyondRangeError, refuse_beyond
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import Array, by_value, contiguous, pair

SMALLEST = 4
"""Coefficients of a cubic spline of one cell."""


@frozen
class DuhemSlopes:
    """Slopes (V/V) of the rising and the falling branches between ``lower`` and ``upper`` (V).

    ``rising`` and ``falling``, shape (n + 3, m + 3), are coefficients of B-splines on n uniform
    cells of u, and m of the distance from the centre curve, from the first to the second of
    ``widths`` (V); beyond these the slopes are those on the edge. The ``centre`` curve begins at
    ``offset`` (V), and its slope is that spline of n + 3 coefficients. ``rest`` (V) is the output
    of a depolarised scanner at 0 V.

    Raises InputError where a slope may be zero or less: only a growing output has an inverse.
    """

    lower: float = field(converter=float)
    upper: float = field(converter=float)
    offset: float = field(converter=float)
    rest: float = field(converter=float)
    widths: tuple[float, float] = field(converter=pair)
    centre: Array = field(converter=contiguous, eq=by_value)
    rising: Array = field(converter=contiguous, eq=by_value)
    falling: Array = field(converter=contiguous, eq=by_value)

    def __attrs_post_init__(self) -> None:
        shape = self.rising.shape
        if len(shape) != 2 or self.falling.shape != shape or self.centre.shape != shape[:1]:  # noqa: PLR2004 - two sides
            raise InputError(
                "the slopes of a Duhem operator are two tables of one shape, with a centre as long"
                f" as their first side, not {shape}, {self.falling.shape}, {self.centre.shape}"
            )
        if min(shape) < SMALLEST:
            raise InputError(f"a table of slopes has {SMALLEST} rows and columns at least: {shape}")
        for name, (low, high) in {"range": (self.lower, self.upper), "widths": self.widths}.items():
            if not (low < high and np.isfinite([low, high]).all()):
                raise InputError(f"a Duhem operator's {name} must grow: {low}, {high}")
        if not np.isfinite([self.offset, self.rest, self.centre.sum()]).all():
            raise InputError("a Duhem operator's offset, rest and centre curve are finite")
        self._refuse_where_not_growing()

    def _refuse_where_not_growing(self) -> None:
        """Splines lie between their least and greatest coefficients."""
        for name, table in (("rising", self.rising), ("falling", self.falling)):
            if not (table.min() > 0.0 and table.max() < np.inf):
                i = np.argwhere(~((table > 0.0) & (table < np.inf)))[0][0]
                at = self.lower + (i - 1) * self.grid[1]
                raise InputError(
                    f"the {name} slope of a Duhem operator is not positive about u = {at:.4g} V, so"
                    " it has no inverse: smooth its data"
                )

    @property
    def drive_range(self) -> tuple[float, float]:
        """Least and greatest input (V) that was identified."""
        return self.lower, self.upper

    @property
    def grid(self) -> Grid:
        """Lowest input and its cell, lowest distance and its cell, V."""
        (rows, columns), (low, high) = self.rising.shape, self.widths
        wide, high_cell = (self.upper - self.lower) / (rows - 3), (high - low) / (columns - 3)
        return self.lower, wide, low, high_cell

    @property
    def chord(self) -> float:
        """Mean slope of the centre curve: the best single gain over the whole range."""
        _, heights = self.curve
        return float(heights[-1] - heights[0]) / (self.upper - self.lower)

    @property
    def curve(self) -> Centre:
        """Slope's coefficients and heights of the centre curve."""
        rises = np.convolve(self.centre, np.array([1.0, 11.0, 11.0, 1.0]) / 24.0, "valid")
        heights = self.offset + self.grid[1] * np.concatenate([[0.0], np.cumsum(rises)])
        return self.centre, heights

    def heights(self, inputs: Array) -> Array:
        """Heights (V) of the centre curve at inputs (V), both (n,)."""
        return heights(self.curve, self.grid, inputs)

    def height(self, u: float) -> float:
        """Height (V) of the centre curve at an input (V)."""
        return float(self.heights(np.array([u]))[0])

    def with_share(self, share: float) -> "DuhemSlopes":
        """Return the operator ``share`` times as far from its centre, or raise InputError."""
        if share == 0.0:
            flat = np.repeat(self.centre[:, np.newaxis], self.rising.shape[1], axis=1)
            return evolve(self, rising=flat, falling=flat, rest=self.height(0.0))
        about = self.centre[:, np.newaxis]
        rising, falling = (about + share * (t - about) for t in (self.rising, self.falling))
        low, high = self.widths
        origin = self.height(0.0)
        rest = origin + share * (self.rest - origin)
        widths = share * low, share * high
        return evolve(self, rising=rising, falling=falling, widths=widths, rest=rest)


class Duhem(CausalInverse):
    """Hysteresis of one axis, with its exact inverse.

    The state of either, shape (2,), is the last input (V) and the output's distance (V) from the
    centre curve. What is or needs an input beyond the identified range raises BeyondRangeError.
    """

    def __init__(self, slopes: DuhemSlopes) -> None:
        self.slopes = slopes
        about = slopes.centre[:, np.newaxis]
        tables = np.stack((slopes.rising - about, slopes.falling - about))
        self._operator = tables, slopes.curve, slopes.grid

    def at_rest(self) -> Array:
        """State of a depolarised scanner at 0 V."""
        rest = float(np.clip(0.0, self.slopes.lower, self.slopes.upper))
        return np.array([rest, self.slopes.rest - self.slopes.height(rest)])

    def apply(self, state: Array, block: Array) -> tuple[Array, Array]:
        """Effective inputs F (V) for a block of inputs u (V), both (n,)."""
        refuse_beyond(block, self.slopes.lower, self.slopes.upper)
        now = state.copy()
        result = by_input(*self._operator, now, block)
        return now, result

    def invert(self, state: Array, block: Array) -> tuple[Array, Array]:
        """Inputs u (V) that give a block of effective inputs F (V), both (n,)."""
        now, result = state.copy(), np.empty(len(block))
        done, limit = by_output(*self._operator, now, block, result)
        if done < len(block):
            raise BeyondRangeError(done, float(block[done]), limit)
        return now, result
