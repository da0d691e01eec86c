"""Hysteresis by plays with viscous friction.

Equations: the Preisach hysteresis P(u) is a sum of plays p_r of thresholds r (V), each with its own
curve T_r (V), and a reversible part. A viscous film of the time constant τ (s) delays each play:

    F = P(u) + Σ_r (T_r(p_r) - T_r(q_r)),    q_r ← min(max(q_r, u - r), u + r),
    τ dp_r/dt = e, the part of u - p_r beyond ±r

or with thermal activation τ dp_r/dt = ±a (e^{|e|/a} - 1), with a in V. At a steady rate v a play
then lags by a ln(1 + v τ / a) (L. Prandtl, ZAMM 8 (1928) 85).

At rates far below 1/τ, p equals q. After a reversal of the drive a play stands still until the
drive has crossed it, unlike with a lag of the whole drive. T_r: see ``curves``. The next stage gets
the mean over each hold. Source: Maxwell's slip elements, M. Goldfarb and N. Celanovic, IEEE Control
Systems 17 (1997) 69, with a dashpot at each block.
"""

import math

import numpy as np

from afm_scan_ros.core.compiled import compiled, inlined
from afm_scan_ros.core.effects.base import CausalInverse
from afm_scan_ros.core.effects.hysteresis.everett import (
    BeyondRangeError,
    EverettSurface,
    evenly_spaced,
)
from afm_scan_ros.core.effects.hysteresis.preisach import Memory, Preisach
from afm_scan_ros.core.effects.hysteresis.walk import INPUT, OUTPUT, Surface, looked_up, try_input
from afm_scan_ros.core.effects.lti import mean_over_holds, pole_of
from afm_scan_ros.core.errors import SampleError
from afm_scan_ros.core.types import Array

EXACT = 1e-13
"""Share of the function's range; the share that rounding limits it to."""
ROUNDS = 100
LARGEST_CORRECTION = 0.5
"""Of the slope, by the curvature: beyond, the curvature holds no longer."""


@inlined
def first_try(k: int, wanted: Array, u: float, last: float, bounds: tuple[float, float]) -> float:
    """Return the first try for a sample: on from ``last`` to ``u``, in proportion to ``wanted``."""
    grown = 1.0
    if k > 1 and wanted[k - 1] != wanted[k - 2]:
        grown = (wanted[k] - wanted[k - 1]) / (wanted[k - 1] - wanted[k - 2])
    there = u + min(max(grown, 0.0), 2.0) * (u - last)
    return min(max(there, bounds[0]), bounds[1])


@inlined
def halley(miss: float, slope: float, curvature: float) -> float:
    """Return Halley's step towards a miss of zero, Newton's without curvature; inf where level."""
    if not slope > 0.0:
        return math.copysign(np.inf, -miss)
    step = -miss / slope
    share = -0.5 * step * curvature / slope
    return step / (1.0 - min(max(share, -LARGEST_CORRECTION), LARGEST_CORRECTION))


@compiled
def next_try(
    u: float, step: float, tried: tuple[float, float], bounds: tuple[float, float]
) -> float:
    """Return a step's end; where it leaves the bracket, the bracket's middle or the outer bound."""
    there = u + step
    if tried[0] < there < tried[1]:
        return there
    side = 0 if step < 0.0 else 1
    outer = tried[side] == bounds[side] and u != bounds[1 - side]
    return bounds[side] if outer else 0.5 * (tried[0] + tried[1])


def refuse_unsolved(solved: int, wanted: Array, found: Array) -> None:
    """Raise for the sample after those ``solved``, if any, of effective inputs ``wanted`` (V).

    BeyondRangeError where the nearest within reach was ``found``, SampleError where NaN was.
    """
    if solved == len(wanted):
        return
    value, reached = float(wanted[solved]), float(found[solved])
    if np.isfinite(reached) or not np.isfinite(value):
        raise BeyondRangeError(solved, value, reached)
    raise SampleError(
        solved,
        f"no drive was found for an effective input of {value:.6g} V in {ROUNDS} steps: identify"
        " the hysteresis anew, or remove what was added to it",
    )


Law = tuple[float, float, float]
"""Shares that remain of a small pull in the mean over a hold, and at its end; a in cells."""
State = tuple[Memory, Array]


SMALLEST = 1.0 / 6.0  # cells, threshold of the loops within one: their centre of gravity


def curves(surface: EverettSurface) -> tuple[Array, Array]:
    """Return a surface as plays: thresholds in cells (n,), and each T_r at the cells, (n, n + 1).

    T_r is the sum over the diagonal of cells of the threshold r. One triangle of each cell on the
    main diagonal has loops smaller than the grid resolves, and half of what the next diagonal has.
    """
    even = evenly_spaced(surface)
    falls = 2.0 * even.values
    masses = falls[1:, :-1] - falls[:-1, :-1] - falls[1:, 1:] + falls[:-1, 1:]
    count = len(masses)
    thresholds, result = 0.5 * np.arange(float(count)), np.zeros((count, count + 1))
    thresholds[0] = SMALLEST
    for k in range(1, count):
        result[k, 1 : count - k + 1] = np.cumsum(np.diag(masses, -k))
    next_to = np.diag(masses, -1)
    result[0, 1:] = 0.5 * np.cumsum(np.interp(np.arange(count), np.arange(1, count) - 0.5, next_to))
    return thresholds, result


@inlined
def _at(curve: Array, k: int, place: float) -> tuple[float, float]:
    """T of the k-th play at a place in cells from the lower limit, and its slope."""
    way = place - 0.5 * k
    i = min(max(int(way), 0), curve.shape[1] - 2)
    slope = curve[k, i + 1] - curve[k, i]
    return curve[k, i] + (way - i) * slope, slope


@inlined
def _drawn(block: float, place: float, threshold: float) -> float:
    return min(max(block, place - threshold), place + threshold)


@inlined
def _decay(pull: float, way: float, along: float, before: float, a: float) -> float:
    """e^{-|pull|/a}, where the place moved a ``way`` since the last hold, ``along`` e^{-|way|/a}.

    ``before`` is the same at the end of the last hold, with the sign of its pull, or 0 if unknown.
    """
    if pull * way > 0.0 and pull * before > 0.0:
        return abs(before) * along
    return math.exp(-abs(pull) / a)


@inlined
def _remaining(pull: float, share: float, a: float, decay: float) -> tuple[float, float, float]:
    """Remainder of a pull, and its two derivatives: 1 - e^{-|pull|/a} falls by the ``share``."""
    if a == np.inf:
        return share * pull, share, 0.0
    signed, decayed = math.copysign(a, pull), 1.0 - share + share * decay
    kept = share * decay / decayed
    return -signed * math.log(decayed), kept, kept * (kept - 1.0) / signed


@inlined
def _held_back(
    place: float, last: float, plays: tuple[Array, Array], law: Law, blocks: Array, decays: Array
) -> tuple[float, float, float]:
    """Σ (T(p) - T(q)) in a hold at a place in cells, after the last; its two derivatives.

    ``blocks`` are p and q before it; ``decays`` those of the pulls after the last hold, and now.
    """
    (thresholds, curve), (share, _, a) = plays, law
    way = place - last
    along, total, slope, curvature = math.exp(-abs(way) / a), 0.0, 0.0, 0.0
    for k in range(thresholds.size):
        late, moves, bends = blocks[0, k], 0.0, 0.0
        drawn = _drawn(late, place, thresholds[k])
        free = _drawn(blocks[1, k], place, thresholds[k])
        if drawn != late:
            pull = drawn - late
            decays[1, k] = _decay(pull, way, along, decays[0, k], a)
            remaining, kept, bends = _remaining(pull, share, a, decays[1, k])
            late, moves = drawn - remaining, 1.0 - kept
        if late != free:
            (behind, rise), (ahead, free_rise) = _at(curve, k, late), _at(curve, k, free)
            total += behind - ahead
            slope += moves * rise - (free_rise if free != blocks[1, k] else 0.0)
            curvature -= bends * rise
    return total, slope, curvature


@inlined
def _draw(place: float, thresholds: Array, law: Law, blocks: Array, decays: Array) -> None:
    """Move the blocks through a hold at a place, where each pull decays by ``decays[1]``."""
    _, share, a = law
    for k in range(thresholds.size):
        drawn, late = _drawn(blocks[0, k], place, thresholds[k]), blocks[0, k]
        blocks[1, k], decays[0, k] = _drawn(blocks[1, k], place, thresholds[k]), 0.0
        if drawn != late:
            blocks[0, k] = drawn - _remaining(drawn - late, share, a, decays[1, k])[0]
            decays[0, k] = math.copysign(1.0 - share + share * decays[1, k], drawn - late)


@compiled
def _apply(
    last: float,
    plays: tuple[Array, Array],
    law: Law,
    blocks: Array,
    places: Array,
    result: Array,
) -> None:
    decays = np.zeros_like(blocks)
    for k in range(places.size):
        result[k] += _held_back(places[k], last, plays, law, blocks, decays)[0]
        _draw(places[k], plays[0], law, blocks, decays)
        last = places[k]


@compiled
def _invert(
    surface: Surface,
    memory: tuple[Array, int, Array],
    film: tuple[tuple[Array, Array], Law, Array],
    block: Array,
    result: Array,
) -> tuple[int, int]:
    """Return the memory's depth, and how many samples were within range."""
    (tables, axes, _), (stack, depth, now), (plays, law, blocks) = surface, memory, film
    lower, upper, height = axes[0, 0], axes[0, -1], 2.0 * tables[0, 0, -1]
    step, decays = (upper - lower) / (axes.shape[1] - 1), np.zeros_like(blocks)
    last, u = now[INPUT], now[INPUT]
    for k in range(block.size):
        last, u = u, first_try(k, block, u, last, (lower, upper))
        tried, before = (lower, upper), (last - lower) / step
        for _ in range(ROUNDS):
            turned, forced, per = try_input(surface, (stack, depth), now, u)
            place = (u - lower) / step
            held, slope, bend = _held_back(place, before, plays, law, blocks, decays)
            miss = forced + held - block[k]
            if abs(miss) <= EXACT * height:
                break
            tried = (tried[0], u) if miss > 0.0 else (u, tried[1])
            towards = halley(miss, per + slope / step, bend / step**2)
            there = next_try(u, towards, tried, (lower, upper))
            if there == u:
                result[k] = block[k] + miss  # what is within reach now
                return depth, k
            u = there
        if not abs(miss) <= EXACT * height:
            result[k] = np.nan
            return depth, k
        result[k], depth, now[INPUT], now[OUTPUT] = u, turned, u, forced
        _draw((u - lower) / step, plays[0], law, blocks, decays)
    return depth, block.size


class ViscousPlays(CausalInverse):
    """Preisach hysteresis with a film of a time constant (s); state: Memory, and p, q in cells.

    Where the ``activation`` (V) is infinite the film is viscous alone.
    """

    def __init__(
        self, surface: EverettSurface, lag: float, sample_period: float, activation: float = np.inf
    ) -> None:
        self._preisach = Preisach(surface)
        self._surface = looked_up(surface.values, surface.levels)
        self._plays = curves(surface)
        step = (surface.upper - surface.lower) / (len(surface.values) - 1)
        self._grid = surface.lower, step
        held = mean_over_holds(pole_of(lag), sample_period)
        self._law = float(held.c[0]), float(held.a[0, 0]), activation / self._grid[1]

    def at_rest(self) -> State:
        """State of a scanner that was depolarised and has long rested at zero."""
        thresholds, cells = self._plays[0], len(self._plays[0])
        middle = np.clip(self._place(np.zeros(1)), thresholds, cells - thresholds)
        return self._preisach.at_rest(), np.stack((middle, middle))

    def apply(self, state: State, block: Array) -> tuple[State, Array]:
        """Effective inputs F (V) for a block of inputs u (V), both (n,)."""
        memory, result = self._preisach.apply(state[0], block)
        blocks, places = state[1].copy(), self._place(np.append(state[0].now[INPUT], block))
        _apply(places[0], self._plays, self._law, blocks, places[1:], result)
        return (memory, blocks), result

    def invert(self, state: State, block: Array) -> tuple[State, Array]:
        """Inputs u (V) that give a block of effective inputs F (V), both (n,)."""
        memory, blocks = state[0], state[1].copy()
        stack = np.hstack((memory.extrema, np.empty((2, len(block)))))
        now, result = memory.now.copy(), np.empty_like(block)
        depth, found = _invert(
            self._surface,
            (stack, memory.extrema.shape[1], now),
            (self._plays, self._law, blocks),
            block,
            result,
        )
        refuse_unsolved(found, block, result)
        self._preisach.surface.refuse_other_inputs(result)
        return (Memory((stack[:, :depth].copy(),), now), blocks), result

    def _place(self, inputs: Array) -> Array:
        """Inputs (V) in cells from the lower limit."""
        lower, step = self._grid
        return (inputs - lower) / step
