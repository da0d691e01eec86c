"""The compiled walk along the Preisach model's memory, forwards and inverse.

The memory is a stack of pairs (input, output), shape (2, depth), at the extrema that have not
been wiped out: a minimum at even depth, a maximum at odd depth, the first the negative
saturation. So an odd number of pairs means that the input rises. A falling branch is a rising
one seen in a mirror that exchanges alpha and -beta, hence two tables and one set of formulas:
``tables[0][base, target]`` is E of a rise over the levels ``axes[0]``, ``tables[1]`` of a fall.

Between two levels a branch is straight. So the memory is looked at only where the motion turns,
leaves a cell or passes an extremum; all samples between lie on one straight line.
"""

import numpy as np
from numpy.typing import NDArray

from afm_scan_ros.core.compiled import compiled, inlined
from afm_scan_ros.core.types import Array

INPUT, OUTPUT = 0, 1  # rows of the stack
Line = tuple[float, float, float, float, float]
"""Where it begins (input, output), the input where it ends, and dF/du ahead and back."""
Surface = tuple[Array, Array, NDArray[np.int64]]
"""Tables (2, n, n), axes (4, n) and the cells in which even bins of the range begin.

The axes are the levels of both tables, and one over the width of the cell above each; above the
last level there is none, and it is the bins a volt.
"""
BINS = 4
"""Bins of the range at most, over the cells: the search for a cell then ends within a step or few.
"""
BASE = 2  # pairs that nothing wipes out: the saturation and the branch it ends


def looked_up(values: Array, levels: Array) -> Surface:
    """Lay out a surface's values (n, n) over its levels (n,) for the walk."""
    axes = np.stack((levels, -levels[::-1]))
    cells = len(levels) - 1
    narrowest = float((levels[-1] - levels[0]) / np.diff(levels).min())
    bins = min(int(np.rint(narrowest)), BINS * cells)
    begins = [np.linspace(axis[0], axis[-1], bins, endpoint=False) for axis in axes]
    after = [np.searchsorted(axis, at, "right") for axis, at in zip(axes, begins, strict=True)]
    per = np.hstack((1.0 / np.diff(axes), np.full((2, 1), bins / np.ptp(levels))))
    tables = np.stack((values.T, values[::-1, ::-1]))
    return tables, np.vstack((axes, per)), np.clip(after, 1, cells) - 1


@inlined
def cell(axes: Array, bins: NDArray[np.int64], fall: int, position: float) -> int:
    """Index of the cell that holds a position."""
    k = int((position - axes[fall, 0]) * axes[fall + 2, axes.shape[1] - 1])
    i = int(bins[fall, min(max(k, 0), bins.shape[1] - 1)])
    while axes[fall, i + 1] <= position and i < axes.shape[1] - 2:
        i += 1
    return i


@inlined
def _level(tables: Array, fall: int, j: int, b: float, target: int) -> float:
    """E between a base, by a share b above level j, and a target level above its cell."""
    return float((1.0 - b) * tables[fall, j, target] + b * tables[fall, j + 1, target])


@inlined
def _found(tables: Array, fall: int, j: int, b: float, value: float, start: int) -> int:
    """Cell in which E(base, …) passes a value, walking cells from ``start``."""
    i = max(start, j)
    while i > j and _level(tables, fall, j, b, i) > value:
        i -= 1
    while i < tables.shape[1] - 2 and _level(tables, fall, j, b, i + 1) < value:
        i += 1
    return i


@inlined
def remember(
    stack: Array, depth: int, now: Array | tuple[float, float], side: int, target: float
) -> int:
    """Push the present pair where the motion turns; drop the pairs that ``target`` wipes out."""
    way = 2 * (depth % 2) - 1
    if way * target < way * now[side]:
        stack[INPUT, depth], stack[OUTPUT, depth] = now[INPUT], now[OUTPUT]
        depth += 1
        way = -way
    while depth > BASE and way * target >= way * stack[side, depth - 2]:
        depth -= 2
    return depth


@inlined
def _line(
    surface: Surface, memory: tuple[Array, int], here: float, given: int, target: float
) -> Line:
    """Straight piece of the branch on which ``target`` lies, sought from the input ``here`` on."""
    tables, axes, bins = surface
    stack, depth = memory
    # A fall is seen in the mirror: its positions are the inputs' negatives.
    fall = 1 - depth % 2
    way, twice = 1 - 2 * fall, 2 - 4 * fall
    u, f = stack[INPUT, depth - 1], stack[OUTPUT, depth - 1]
    j = cell(axes, bins, fall, way * u)
    b = (way * u - axes[fall, j]) * axes[fall + 2, j]
    if given == INPUT:
        i = max(cell(axes, bins, fall, way * target), j)
    else:
        start = cell(axes, bins, fall, way * here)
        i = _found(tables, fall, j, b, (target - f) / twice, start)
    begin, end = way * axes[fall, i], way * axes[fall, i + 1]
    twice_per = 2.0 * axes[fall + 2, i]
    back = twice_per * tables[fall, i, i + 1]
    if i == j:
        return u, f, end, back, back
    near, far = _level(tables, fall, j, b, i), _level(tables, fall, j, b, i + 1)
    return begin, f + twice * near, end, twice_per * (far - near), back


@inlined
def try_input(
    surface: Surface, memory: tuple[Array, int], now: Array, target: float
) -> tuple[int, float, float]:
    """Depth after an input, output and dF/du there; only what lies above the depth is written."""
    stack, depth = memory
    depth = remember(stack, depth, now, INPUT, target)
    u, f, _, ahead, _ = _line(surface, (stack, depth), now[INPUT], INPUT, target)
    return depth, f + ahead * (target - u), ahead


@inlined
def _follow(
    line: Line, way: int, given: int, block: Array, result: Array, k: int
) -> tuple[int, float, float]:
    """Go along a line from sample ``k``, which lies on it, to the first sample that does not.

    Returned are that sample's index and the farthest point (given, other). Back from there, within
    one cell, the branch is straight too, the same down and up: so it needs no memory.
    """
    u, f, end, ahead, back = line
    begin, x0, y0 = u, u, f
    if given == OUTPUT:
        x0, y0, end, ahead, back = f, u, f + ahead * (end - u), 1.0 / ahead, 1.0 / back
    far = block[k]
    result[k] = y0 + ahead * (far - x0)
    k += 1
    while k < len(block):
        x = block[k]
        reached = way * max(way * far, way * x)
        y = y0 + ahead * (reached - x0) + back * (x - reached)
        u = x if given == INPUT else y
        if not (way * u >= way * begin and way * reached < way * end):
            break
        result[k], far = y, reached
        k += 1
    return k, far, y0 + ahead * (far - x0)


@compiled
def walk(
    surface: Surface,
    limits: tuple[float, float],
    given: int,
    memory: tuple[Array, int, bool],
    now: Array,
    block: Array,
    result: Array,
) -> tuple[int, int]:
    """Outputs for a block of inputs, or inputs for one of outputs: whichever is ``given``.

    ``memory`` is the stack, with room for one more pair a sample, its depth, and whether more lies
    deeper. It and ``now`` (input, output) are moved on. Returned are the new depth and how many
    samples were done: the next one lies beyond the ``limits``, or wipes out what lies deeper.
    """
    (stack, depth, deeper), k, here = memory, 0, (now[INPUT], now[OUTPUT])
    while k < len(block) and limits[0] <= block[k] <= limits[1]:
        depth = remember(stack, depth, here, given, block[k])
        if deeper and depth <= BASE:
            now[INPUT], now[OUTPUT] = here
            return depth, k
        u, f, end, ahead, back = _line(surface, (stack, depth), here[INPUT], given, block[k])
        way = 2 * (depth % 2) - 1
        if depth > BASE:
            end = way * min(way * end, way * stack[INPUT, depth - 2])
        k, far, there = _follow((u, f, end, ahead, back), way, given, block, result, k)
        here = (far, there) if given == INPUT else (there, far)
    if k > 0:
        depth = remember(stack, depth, here, given, block[k - 1])
        now[given], now[1 - given] = block[k - 1], result[k - 1]
    return depth, k


@compiled
def walk_copy(
    surface: Surface,
    limits: tuple[float, float],
    given: int,
    memory: tuple[Array, bool],
    now: Array,
    block: Array,
    result: Array,
) -> tuple[Array, Array, int]:
    """Walk on from a memory that stays as it is: a stack, and whether more lies deeper than it.

    Returned are the stack after it, (2, depth), the present pair and how many samples were done.
    """
    before, deeper = memory
    depth, now = before.shape[1], now.copy()
    stack = np.empty((2, depth + block.size))
    stack[:, :depth] = before
    depth, done = walk(surface, limits, given, (stack, depth, deeper), now, block, result)
    return stack[:, :depth].copy(), now, done
