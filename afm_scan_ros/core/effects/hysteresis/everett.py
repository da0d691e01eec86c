"""The Everett surface: half the change of output along each first-order reversal curve."""

import numpy as np
from attrs import evolve, field, frozen
from attrs.converters import optional
from numpy.typing import NDArray

from afm_scan_ros.core.errors import InputError, SampleError
from afm_scan_ros.core.types import Array, by_value, contiguous, pair

ROUNDING = 1e-12
"""Share of a range by which sums of some thousand terms may be rounded beyond it."""


class BeyondRangeError(SampleError):
    """A sample of ``value`` (V) lies beyond a ``limit`` (V) of what was identified."""

    def __init__(self, sample: int, value: float, limit: float) -> None:
        super().__init__(
            sample,
            f"{value:.6g} V is {abs(value - limit):.2g} V beyond the identified range's limit of"
            f" {limit + 0.0:.6g} V: scan a smaller range, more slowly or farther from that limit,"
            " or identify a larger range",
        )
        self.value = value
        self.limit = limit


@frozen
class EverettSurface:
    """E(alpha, beta) on a grid: half of what a fall from alpha to beta takes back.

    Croft, Shed and Devasia (2001), Eq. 16: E = (F_alpha - F_alpha_beta) / 2, with the output
    F_alpha when the input has risen from ``lower`` to alpha, F_alpha_beta when it has then fallen
    to beta. ``values[i, j]``, shape (n, n), is E at alpha = levels[i], beta = levels[j], valid
    for i ≥ j and zero for i = j. ``offset`` is the output at ``lower``, the negative saturation.
    The levels are evenly spaced, or those of ``uneven`` (V), shape (n,). Where the surface reaches
    beyond the inputs that were identified, these have a range of their own, ``within`` (V).
    Between the levels E is bilinear, in the triangles along the diagonal linear. A depolarised
    scanner is as after an oscillation that faded from both limits, its middle at ``bias`` (V) times
    the square of its amplitude over the limit's: what is symmetric in the material need not be so
    in the drive. Without a bias it faded by pairs of equal swings.

    Raises InputError where E does not grow strictly with alpha and as beta falls: only then has
    the hysteresis an inverse.
    """

    lower: float = field(converter=float)
    upper: float = field(converter=float)
    values: Array = field(converter=contiguous, eq=by_value)
    offset: float = field(converter=float)
    bias: float | None = field(default=None, converter=optional(float))
    uneven: Array | None = field(default=None, converter=optional(contiguous), eq=by_value)
    within: tuple[float, float] | None = field(default=None, converter=optional(pair))

    def __attrs_post_init__(self) -> None:
        n = len(self.values)
        if self.values.shape != (n, n) or n < 2:  # noqa: PLR2004 - one cell has two levels
            raise InputError(f"an Everett surface is square, not of shape {self.values.shape}")
        if not self.lower < self.upper or not np.isfinite([self.lower, self.upper]).all():
            raise InputError(f"an Everett surface needs lower < upper: {self.lower}, {self.upper}")
        self._refuse_other_levels()
        least, most = self.drive_range
        if not self.lower <= least < most <= self.upper:
            raise InputError(
                f"inputs from {least} to {most} V are no range of a surface from {self.lower} to"
                f" {self.upper} V"
            )
        below = self.values[np.tril_indices(n)]
        if not np.isfinite([*below, self.offset]).all() or np.diag(self.values).any():
            raise InputError(
                "an Everett surface is finite where alpha >= beta, and 0 on the diagonal"
            )
        self._refuse_where_not_monotone()

    def _refuse_other_levels(self) -> None:
        levels = self.levels
        ends = [self.lower, self.upper]
        if levels.shape != (len(self.values),) or [levels[0], levels[-1]] != ends:
            raise InputError(
                f"an Everett surface has a level for each of its {len(self.values)} rows, from"
                f" {self.lower} to {self.upper} V"
            )
        if not (np.diff(levels) > 0.0).all():
            raise InputError("the levels of an Everett surface rise from one to the next")

    def _refuse_where_not_monotone(self) -> None:
        inside = np.tri(len(self.values), dtype=bool)
        falls = (np.diff(self.values, axis=0) <= 0.0) & inside[:-1]
        rises = (np.diff(self.values, axis=1) >= 0.0) & inside[:, 1:]
        for bad, name in ((falls, "grow with alpha"), (rises, "grow as beta falls")):
            if bad.any():
                i, j = np.argwhere(bad)[0]
                raise InputError(
                    f"the Everett surface does not {name} at alpha = {self.levels[i]:.4g} V,"
                    f" beta = {self.levels[j]:.4g} V, so it has no inverse: smooth its data"
                )

    @property
    def levels(self) -> Array:
        """Levels of alpha and of beta, shape (n,)."""
        if self.uneven is not None:
            return self.uneven
        return np.linspace(self.lower, self.upper, len(self.values))

    @property
    def drive_range(self) -> tuple[float, float]:
        """Least and greatest input (V) that was identified."""
        return self.within or (self.lower, self.upper)

    def refuse_other_inputs(self, inputs: Array) -> None:
        """Raise BeyondRangeError at the first of inputs (V), (n,), that was not identified."""
        refuse_beyond(rounded_into(inputs, *self.drive_range), *self.drive_range)

    @property
    def output_lower(self) -> float:
        """Output at negative saturation."""
        return self.offset

    @property
    def output_upper(self) -> float:
        """Output at positive saturation."""
        return self.offset + 2.0 * float(self.values[-1, 0])

    @property
    def chord(self) -> float:
        """Slope of the major loop from end to end: the best single gain over the whole range."""
        return (self.output_upper - self.output_lower) / (self.upper - self.lower)

    def with_share(self, share: float) -> "EverettSurface":
        """Return the surface of R + share H; raises InputError where that has no inverse."""
        levels = reversible(self)
        without = np.tril(0.5 * (levels[:, np.newaxis] - levels))
        values = share * self.values + (1.0 - share) * without
        offset = share * self.offset + (1.0 - share) * levels[0]
        return evolve(self, values=values, offset=float(offset))


def grown(values: Array, levels: Array, least: float) -> tuple[Array, float]:
    """Return E that grows everywhere by a ``least`` slope (1), near ``values`` on ``levels`` (V).

    That is the middle between the least surface above them that grows and the greatest below. The
    second result is the share of a surface without hysteresis that is mixed in.
    """
    inside, half = np.tri(len(levels), dtype=bool), 0.5 * (levels[1] - levels[0])
    lowest = float(min(map(np.min, _rises(values, inside)))) / half
    if lowest >= least:
        return values, 0.0
    above = np.where(inside, values, -np.inf)
    above = np.maximum.accumulate(np.maximum.accumulate(above, axis=0)[:, ::-1], axis=1)[:, ::-1]
    below = np.where(inside, values, np.inf)
    below = np.minimum.accumulate(np.minimum.accumulate(below[::-1], axis=0)[::-1], axis=1)
    middle = np.where(inside, 0.5 * (above + np.maximum(below, 0.0)), 0.0)
    lowest = float(min(map(np.min, _rises(middle, inside)))) / half
    share = float(max(least - lowest, 0.0) / (1.0 - min(lowest, least)))
    straight = np.tril(0.5 * (levels[:, np.newaxis] - levels))
    return middle + share * (straight - middle), share


def grown_beyond(values: Array, inside: slice, least: float) -> Array:
    """Return E (n, n) that grows by ``least`` (V) from level to level, also beyond those inside."""
    result, floor = values.copy(), least * np.arange(len(values))
    for j in range(inside.start - 1, -1, -1):
        column = np.maximum(result[j + 1 :, j], result[j + 1 :, j + 1] + least)
        result[j + 1 :, j] = np.maximum.accumulate(column - floor[j + 1 :]) + floor[j + 1 :]
    for i in range(inside.stop, len(values)):
        row = np.maximum(result[i, :i], result[i - 1, :i] + least)[::-1]
        result[i, :i] = (np.maximum.accumulate(row - floor[:i]) + floor[:i])[::-1]
    return result


def _rises(values: Array, inside: NDArray[np.bool_]) -> tuple[Array, Array]:
    """Changes of E from level to level, as alpha rises and as beta falls."""
    return np.diff(values, axis=0)[inside[:-1]], -np.diff(values, axis=1)[inside[:, 1:]]


def evenly_spaced(surface: EverettSurface) -> EverettSurface:
    """Return a surface of as many levels, evenly spaced, read from one with others."""
    if surface.uneven is None:
        return surface
    even = evolve(surface, uneven=None)
    shares = [np.interp(even.levels, surface.levels, each) for each in np.eye(len(even.values))]
    below = np.tril(surface.values)
    # As an odd function across the diagonal, E is bilinear in the cells on it too.
    between = np.transpose(shares) @ (below - below.T) @ shares
    return evolve(even, values=np.tril(between, k=-1))


def rounded_into(block: Array, lower: float, upper: float) -> Array:
    """Return values (n,) with those that rounding put beyond a limit at this limit."""
    near = ROUNDING * (upper - lower)
    if block.size == 0 or (block.min() >= lower and block.max() <= upper):
        return block
    inside = (block >= lower - near) & (block <= upper + near)
    return np.where(inside, np.clip(block, lower, upper), block)


def refuse_beyond(block: Array, lower: float, upper: float) -> None:
    """Raise BeyondRangeError at the first sample that is not within the limits (or not finite)."""
    bad = ~((block >= lower) & (block <= upper))
    if bad.any():
        sample = int(np.argmax(bad))
        value = float(block[sample])
        raise BeyondRangeError(sample, value, lower if value < lower else upper)


def reversible(surface: EverettSurface) -> Array:
    """Return the reversible part R (V) of F = R(u) + H at the levels of the surface, shape (n,).

    R has the slope of the smallest loops at u, each all but closed (Mayergoyz' reversible
    component). H has all memory, and equal values of opposite sign at both saturations.
    """
    rise = 2.0 * np.diag(surface.values, -1)
    levels = np.concatenate(([0.0], np.cumsum(rise)))
    middle = surface.offset + surface.values[-1, 0]
    return np.asarray(middle + levels - 0.5 * levels[-1])
