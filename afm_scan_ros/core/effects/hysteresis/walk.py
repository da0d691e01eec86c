"""The compiled walk along the Preisach model's memory, forwards and inverse.

The memory is a stack of pairs (input, output), shape (2, depth), at the extrema that have not
been wiped out: a minimum at even depth, a maximum at odd depth, the first the negative
saturation. So an odd number of pairs means that the input rises. A falling branch is a rising
one seen in a mirror that exchanges alpha and -beta, hence two tables and one set of formulas, in
grid units 0 … n - 1: ``tables[0][base, target]`` is E of a rise, ``tables[1]`` of a fall.
"""

from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.types import Array

INPUT, OUTPUT = 0, 1  # rows of the stack
BASE = 2  # pairs that nothing wipes out: the saturation and the branch it ends


@compiled
def _cell(table: Array, position: float) -> int:
    """Index of the cell that holds a position."""
    last = len(table) - 2
    return min(max(int(position), 0), last)


@compiled
def _level(table: Array, base: float, target: int) -> float:
    """E between a base anywhere and a target on the grid, in a cell above the base's."""
    j = _cell(table, base)
    b = base - j
    return float((1.0 - b) * table[j, target] + b * table[j + 1, target])


@compiled
def _everett(table: Array, base: float, target: float) -> float:
    """E between a base and a target that is not below it."""
    j, i = _cell(table, base), _cell(table, target)
    if i <= j:
        return float((target - base) * table[j, j + 1])
    near, far = _level(table, base, i), _level(table, base, i + 1)
    return near + (target - i) * (far - near)


@compiled
def _target(table: Array, base: float, value: float, start: int) -> float:
    """Solve E(base, target) = value for the target, walking cells from ``start``."""
    j = _cell(table, base)
    i = max(start, j)
    while i > j and _level(table, base, i) > value:
        i -= 1
    while i < len(table) - 2 and _level(table, base, i + 1) < value:
        i += 1
    if i == j:
        return float(base + value / table[j, j + 1])
    near, far = _level(table, base, i), _level(table, base, i + 1)
    return i + (value - near) / (far - near)


@compiled
def remember(stack: Array, depth: int, now: Array, side: int, target: float) -> int:
    """Push the present pair where the motion turns; drop the pairs that ``target`` wipes out."""
    rising = depth % 2 == 1
    if target != now[side] and (target > now[side]) != rising:
        stack[:, depth] = now
        depth += 1
        rising = not rising
    known = stack[side]
    while depth > BASE and (target >= known[depth - 2] if rising else target <= known[depth - 2]):
        depth -= 2
    return depth


@compiled
def respond(  # the state in pieces, as compiled code wants it
    tables: Array,
    grid: tuple[float, float],
    stack: Array,
    depth: int,
    now: Array,
    block: Array,
    result: Array,
) -> int:
    """Outputs for a block of inputs; ``grid`` is (lowest level, distance of levels).

    ``stack`` has room for one more pair a sample; it and ``now`` (input, output) are moved on,
    and the new depth is returned.
    """
    lower, step = grid
    top = len(tables[0]) - 1
    for k in range(len(block)):
        depth = remember(stack, depth, now, INPUT, block[k])
        base, target = (stack[INPUT, depth - 1] - lower) / step, (block[k] - lower) / step
        if depth % 2 == 1:
            change = 2.0 * _everett(tables[0], base, target)
        else:
            change = -2.0 * _everett(tables[1], top - base, top - target)
        result[k] = stack[OUTPUT, depth - 1] + change
        now[INPUT], now[OUTPUT] = block[k], result[k]
    return depth


@compiled
def drive(
    tables: Array,
    grid: tuple[float, float],
    stack: Array,
    depth: int,
    now: Array,
    block: Array,
    result: Array,
) -> int:
    """Inputs for a block of outputs: the walk of ``respond`` with the stack searched by output.

    The search over cells starts where the last sample ended, so that its cost a sample is
    constant for a motion of bounded speed.
    """
    lower, step = grid
    top = len(tables[0]) - 1
    for k in range(len(block)):
        depth = remember(stack, depth, now, OUTPUT, block[k])
        base, here = (stack[INPUT, depth - 1] - lower) / step, (now[INPUT] - lower) / step
        change = 0.5 * (block[k] - stack[OUTPUT, depth - 1])
        if depth % 2 == 1:
            target = _target(tables[0], base, change, _cell(tables[0], here))
        else:
            start = _cell(tables[1], top - here)
            target = top - _target(tables[1], top - base, -change, start)
        result[k] = lower + step * target
        now[INPUT], now[OUTPUT] = result[k], block[k]
    return depth
