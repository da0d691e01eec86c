"""Everett surfaces of a fit: of its plays, nearest to one state, and of the direct inverse."""

import numpy as np
from attrs import evolve
from scipy.optimize import brentq, nnls

from afm_scan_ros.core.effects.base import Cascade
from afm_scan_ros.core.effects.hysteresis.duhem import Duhem, DuhemSlopes
from afm_scan_ros.core.effects.hysteresis.everett import EverettSurface, grown, grown_beyond
from afm_scan_ros.core.effects.hysteresis.preisach import OutputMap, Preisach
from afm_scan_ros.core.fit.plays import Plays
from afm_scan_ros.core.fit.settings import DEFAULT_SETTINGS, FitSettings
from afm_scan_ros.core.types import Array


def _ends(plays: Plays) -> tuple[float, float]:
    """Ends (V) of the Everett surface: as far to both sides as the range, where that holds 0 V.

    So the memory of depolarised rest is in the surface, also of a drive of one sign.
    """
    if not plays.lower <= 0.0 <= plays.upper:
        return plays.lower, plays.upper
    farthest = max(-plays.lower, plays.upper)
    return -farthest, farthest


def surface_levels(plays: Plays, count: int) -> Array:
    """Levels (V) of the Everett surface, ``count`` of them over the range."""
    lower, upper = _ends(plays)
    whole = 1 + round((count - 1) * (upper - lower) / (plays.upper - plays.lower))
    return np.linspace(lower, upper, whole)


def everett_surface(
    plays: Plays, theta: Array, bias: float | None = None, *, mixed: bool = False
) -> EverettSurface:
    """Return E(alpha, beta), whose output at ``lower`` is that of all plays pushed down to it.

    Its ``bias`` (V) is that of depolarised rest of an oscillation as large as half the range.

    Plays that the surface cannot push both ways stay where they have settled. Where the surface
    does not grow, as a fit that has not converged may leave it, it may be ``mixed`` with a
    straight line so far that it does. Raises InputError where it does not.
    """
    levels = surface_levels(plays, plays.settings.surface_levels)
    values, offset = everett(plays, theta, levels)
    share = 0.0
    if mixed:
        values, share = growing(plays, values, levels)
    return surface_of(plays, values, offset + share * (_ends(plays)[0] - offset), bias)


def growing(plays: Plays, values: Array, levels: Array) -> tuple[Array, float]:
    """Return E (V) at levels (V) that grows, and the share of a straight line mixed in.

    Beyond the range of the drive, which no record tells, it is never less steep than that line.
    """
    within = np.flatnonzero((levels >= plays.lower) & (levels <= plays.upper))
    inside, result = slice(within[0], within[-1] + 1), values.copy()
    least = plays.settings.least_slope
    result[inside, inside], share = grown(values[inside, inside], levels[inside], least)
    return grown_beyond(result, inside, 0.5 * least * (levels[1] - levels[0])), share


def surface_of(plays: Plays, values: Array, offset: float, bias: float | None) -> EverettSurface:
    """Return the surface of ``everett``, with a ``bias`` (V) as that of ``surface``."""
    lower, upper = _ends(plays)
    if bias is not None:
        bias *= (0.5 * (upper - lower) / plays.half) ** 2
    wider = upper - lower > plays.upper - plays.lower
    within = (plays.lower, plays.upper) if wider else None
    return EverettSurface(lower, upper, values, offset, bias, within=within)


def everett(plays: Plays, theta: Array, levels: Array) -> tuple[Array, float]:
    """E (V) at levels (V), (n, n), whether it grows or not, and the output (V) at the first."""
    values, offset, half = np.zeros((len(levels),) * 2), 0.0, 0.5 * (levels[-1] - levels[0])
    each_play = zip(plays.thresholds, plays.settled, plays.tables(theta), strict=True)
    for r, settled, table in each_play:
        if r > half:
            offset += float(np.interp(settled, plays.positions, table))
            continue
        top = levels[:, np.newaxis] - r
        risen, fallen = (
            _continued(plays, table, each) for each in (top, np.minimum(levels + r, top))
        )
        values += 0.5 * (risen - fallen)
        offset += float(_continued(plays, table, levels[0] + r))
    return np.tril(values, -1), offset


def _continued(plays: Plays, table: Array, at: Array) -> Array:
    """T_r at places (V): a table that goes on straight beyond the range, and does not fall."""
    step = plays.positions[1] - plays.positions[0]
    first, last = (max(float(table[i + 1] - table[i]), 0.0) / step for i in (0, -2))
    below, above = np.minimum(at - plays.lower, 0.0), np.maximum(at - plays.upper, 0.0)
    return np.asarray(np.interp(at, plays.positions, table) + first * below + last * above)


def resting(surface: EverettSurface, rest: float, settings: FitSettings) -> EverettSurface:
    """Return a surface whose bias lets it rest at an output (V), as the plays do that it is of.

    With their own bias it would rest up to 1/5000 of the range elsewhere, as there are no loops
    between its levels. Where no bias nearby does so it stays.
    """

    def apart(bias: float) -> float:
        return float(Preisach(evolve(surface, bias=bias)).at_rest().now[1]) - rest

    own, most = surface.bias or 0.0, 0.5 * settings.rest_bias * (surface.upper - surface.lower)
    ends = own - most, own + most
    if apart(ends[0]) * apart(ends[1]) >= 0.0:
        return surface
    return evolve(surface, bias=float(brentq(apart, *ends)))


def from_rest(
    surface: EverettSurface, mapped: OutputMap | None
) -> tuple[EverettSurface, OutputMap | None]:
    """Return a surface and the map behind it moved so that F = 0 at the model's own rest."""
    rest = float(Preisach(surface).at_rest().now[1])
    if mapped is None:
        return evolve(surface, offset=surface.offset - rest), None
    shift = float(mapped.output(np.array([rest]))[0])
    mapped = evolve(mapped, lower=mapped.lower - shift, upper=mapped.upper - shift)
    return evolve(surface, offset=surface.offset - shift), mapped


def direct_of(surface: EverettSurface, mapped: OutputMap | None, count: int) -> EverettSurface:
    """Return the direct inverse's surface of ``count`` levels, from the exact inverse.

    U(alpha, beta) is half of what the drive falls by as F falls from alpha to beta, after it has
    risen from the least F. Croft, Shed and Devasia (2001), Eq. 16, from F to u. Where U hardly
    grows between two levels it is mixed with a straight line.
    """
    behind = () if mapped is None else (mapped,)
    whole = Cascade((Preisach(surface), *behind))
    ends = np.array(surface.drive_range[::-1])
    saturated, (_, low) = whole.apply(whole.at_rest(), ends)
    high = whole.apply(saturated, ends[:1])[1][0]
    levels = np.linspace(low, high, count)
    values = np.zeros((count, count))
    for row in range(1, count):
        there_and_back = np.concatenate([levels[row : row + 1], levels[:row][::-1]])
        drive = whole.invert(saturated, there_and_back)[1]
        values[row, :row] = 0.5 * (drive[0] - drive[:0:-1])
    values, _ = grown(values, levels, DEFAULT_SETTINGS.least_slope)
    return EverettSurface(float(low), float(high), values, surface.drive_range[0])


def nearest_surface(slopes: DuhemSlopes, settings: FitSettings) -> EverettSurface:
    """Return the surface of plays that follow the reversal curves of one state best."""
    turns = np.linspace(slopes.upper, slopes.lower, settings.direct_levels)[1:]
    ends = np.full_like(turns, slopes.upper)
    corners = np.concatenate([[0.0], ends[:1], np.column_stack([turns, ends]).ravel()])
    places = np.arange(len(corners)) * settings.direct_levels
    drive = np.interp(np.arange(places[-1] + 1), places, corners)
    model, plays = Duhem(slopes), Plays(slopes.lower, slopes.upper, settings)
    output = model.apply(model.at_rest(), drive)[1]
    pieces = plays.pieces(
        plays.unbent(), drive, np.arange(len(drive) + 1), plays.at_rest(np.zeros(1))[0]
    )
    columns = np.concatenate([one[:, : len(plays.thresholds)] for one in pieces]).astype(float)
    density, _ = nnls(columns - columns.mean(axis=0), output - output.mean())
    theta = np.zeros_like(plays.unbent())
    theta[: len(density)] = density
    theta[0] = max(theta[0], settings.least_slope)
    return everett_surface(plays, theta, mixed=True)
