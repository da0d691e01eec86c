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
from afm_scan_ros.core.effects.hysteresis.everett import EverettSurface, evenly_spaced
from afm_scan_ros.core.effects.hysteresis.preisach import Memory, Preisach
from afm_scan_ros.core.effects.hysteresis.walk import INPUT, Surface, looked_up, walk
from afm_scan_ros.core.effects.input_lag import held_lag
from afm_scan_ros.core.effects.secant import ANY, EXACT, ROUNDS, next_try, refuse_unsolved
from afm_scan_ros.core.types import Array

Law = tuple[float, float, float]
"""Shares left of a small pull in the mean over a hold, and at its end; a in cells."""
State = tuple[Memory, Array]


SMALLEST = 1.0 / 6.0  # cells, threshold of the loops within one: their centre of gravity


def curves(surface: EverettSurface) -> tuple[Array, Array]:
    """Return a Preisach surface as plays, each with a curve T_r (V) of its own.

    Returns thresholds in cells (n,), and the T_r at consecutive cells of each play (n, n + 1). T_r
    is the sum over the diagonal of cells of the threshold r. One triangle of each cell on the main
    diagonal has loops smaller than the grid resolves, and half of what the next diagonal has.
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
def _at(curve: Array, k: int, place: float) -> float:
    """T of the k-th play at a place in cells from the lower limit."""
    way = place - 0.5 * k
    i = min(max(int(way), 0), curve.shape[1] - 2)
    return float(curve[k, i] + (way - i) * (curve[k, i + 1] - curve[k, i]))


@inlined
def _drawn(block: float, place: float, threshold: float) -> float:
    return min(max(block, place - threshold), place + threshold)


@inlined
def _left(pull: float, share: float, a: float) -> float:
    """What is left of a pull where a share is of a small one: 1 - e^{-|pull|/a} falls by it."""
    if a == np.inf or pull == 0.0:
        return share * pull
    return math.copysign(a * math.log1p(share * math.expm1(-abs(pull) / a)), pull)


@compiled
def _held_back(place: float, plays: tuple[Array, Array], law: Law, blocks: Array) -> float:
    """Σ (T(p) - T(q)) in a hold at a place in cells; ``blocks`` are p and q before it, in cells."""
    thresholds, curve = plays
    total = 0.0
    for k in range(thresholds.size):
        drawn = _drawn(blocks[0, k], place, thresholds[k])
        late = drawn + _left(blocks[0, k] - drawn, law[0], law[2])
        free = _drawn(blocks[1, k], place, thresholds[k])
        if late != free:
            total += _at(curve, k, late) - _at(curve, k, free)
    return total


@compiled
def _draw(place: float, thresholds: Array, law: Law, blocks: Array) -> None:
    """Move the blocks through a hold at a place."""
    for k in range(thresholds.size):
        drawn = _drawn(blocks[0, k], place, thresholds[k])
        blocks[0, k] = drawn + _left(blocks[0, k] - drawn, law[1], law[2])
        blocks[1, k] = _drawn(blocks[1, k], place, thresholds[k])


@compiled
def _apply(
    plays: tuple[Array, Array], law: Law, blocks: Array, places: Array, result: Array
) -> None:
    for k in range(places.size):
        result[k] += _held_back(places[k], plays, law, blocks)
        _draw(places[k], plays[0], law, blocks)


@compiled
def _follow(places: Array, thresholds: Array, law: Law, blocks: Array, result: Array) -> None:
    """Fill the means of p and q (2, n, plays) over each hold, and move the blocks."""
    for i in range(places.size):
        for k in range(thresholds.size):
            drawn = _drawn(blocks[0, k], places[i], thresholds[k])
            result[0, i, k] = drawn + _left(blocks[0, k] - drawn, law[0], law[2])
            result[1, i, k] = _drawn(blocks[1, k], places[i], thresholds[k])
        _draw(places[i], thresholds, law, blocks)


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
    field, forced, after = np.empty(1), np.empty(1), np.empty(2)
    lower, upper, height = axes[0, 0], axes[0, -1], 2.0 * tables[0, 0, -1]
    step = (upper - lower) / (axes.shape[1] - 1)
    u, slope = now[INPUT], height / (upper - lower)
    for k in range(block.size):
        tried, before, moved = (lower, upper), 0.0, 0.0
        for _ in range(ROUNDS):  # the secant's, as F is straight between one kink and the next
            field[0], after[:] = u, now
            turned, _n = walk(surface, ANY, INPUT, (stack, depth, False), after, field, forced)
            miss = forced[0] + _held_back((u - lower) / step, plays, law, blocks) - block[k]
            if abs(miss) <= EXACT * height:
                break
            if moved != 0.0 and miss != before:
                slope = (miss - before) / moved
            tried = (tried[0], u) if miss > 0.0 else (u, tried[1])
            there = next_try(u, -miss / slope, tried, (lower, upper))
            if there == u:
                result[k] = block[k] + miss  # what is within reach now
                return depth, k
            before, moved, u = miss, there - u, there
        if not abs(miss) <= EXACT * height:
            result[k] = np.nan
            return depth, k
        result[k], depth, now[:] = u, turned, after
        _draw((u - lower) / step, plays[0], law, blocks)
    return depth, block.size


class ViscousPlays(CausalInverse):
    """Preisach hysteresis with a film of a time constant (s); state: Memory, and p, q in cells.

    Where the ``activation`` (V) is infinite the film is viscous alone. The inverse solves each
    sample's one equation between its bounds. Samples beyond the surface raise BeyondRangeError.
    """

    def __init__(
        self, surface: EverettSurface, lag: float, sample_period: float, activation: float = np.inf
    ) -> None:
        self._preisach = Preisach(surface)
        self._plays = curves(surface)
        step = (surface.upper - surface.lower) / (len(surface.values) - 1)
        self._grid = surface.lower, step
        self._law = (*held_lag(lag, sample_period), activation / self._grid[1])

    def at_rest(self) -> State:
        """State of a scanner that was depolarised and has long rested at zero."""
        thresholds, cells = self._plays[0], len(self._plays[0])
        middle = np.clip(self._place(np.zeros(1)), thresholds, cells - thresholds)
        return self._preisach.at_rest(), np.stack((middle, middle))

    def apply(self, state: State, block: Array) -> tuple[State, Array]:
        """Effective inputs F (V) for a block of inputs u (V), both (n,)."""
        memory, result = self._preisach.apply(state[0], block)
        blocks = state[1].copy()
        _apply(self._plays, self._law, blocks, self._place(block), result)
        return (memory, blocks), result

    def followed(self, block: Array) -> Array:
        """Means of p and q over each hold (2, n, plays), in cells, for inputs u (V) from rest on.

        They follow from the thresholds alone, whatever the curves.
        """
        blocks = self.at_rest()[1]
        result = np.empty((2, len(block), blocks.shape[1]))
        _follow(self._place(block), self._plays[0], self._law, blocks, result)
        return result

    def invert(self, state: State, block: Array) -> tuple[State, Array]:
        """Inputs u (V) that give a block of effective inputs F (V), both (n,)."""
        (memory, blocks), surface = (state[0], state[1].copy()), self._preisach.surface
        stack = np.hstack((memory.extrema, np.empty((2, len(block)))))
        now, result = memory.now.copy(), np.empty_like(block)
        depth, found = _invert(
            looked_up(surface.values, surface.levels),
            (stack, memory.extrema.shape[1], now),
            (self._plays, self._law, blocks),
            block,
            result,
        )
        refuse_unsolved(found, block, result)
        return (Memory((stack[:, :depth].copy(),), now), blocks), result

    def _place(self, inputs: Array) -> Array:
        """Inputs (V) in cells from the lower limit."""
        lower, step = self._grid
        return (inputs - lower) / step
