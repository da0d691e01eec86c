"""The compiled branches of a Duhem operator: followed by input or by output, or differentiated.

Tables of uniform cubic B-splines over inputs u (V) and over w (V), the output's distance from the
centre curve c(u). On a branch dw/du = h(u, w), from stop to stop of a lattice by Runge and Kutta's
classical method. The stops are the same whatever the samples are, and none lies across a knot of
u: so a branch followed by output meets the one followed by input up to rounding.
"""

from typing import TypeAlias

import numpy as np

from afm_scan_ros.core.compiled import compiled, inlined
from afm_scan_ros.core.types import Array

STOPS = 4
"""Steps of the integration in a cell of u."""
SOLVED = 1e-14
"""Share of the output's range to which an input is solved for."""
TRIALS = 100
"""Newton's steps, or halvings, at most; three are usual."""

Grid: TypeAlias = tuple[float, float, float, float]
"""Lowest input and its cell, lowest w and its cell, V."""
Centre: TypeAlias = tuple[Array, Array]
"""Coefficients of the centre curve's slope (V/V), and its heights (V) at the knots."""
Weights: TypeAlias = tuple[float, float, float, float]


@inlined
def _weights(t: float) -> Weights:
    """Cubic B-splines that are not zero at a share ``t`` of a cell."""
    s = 1.0 - t
    second, third = (3.0 * t - 6.0) * t * t + 4.0, ((3.0 - 3.0 * t) * t + 3.0) * t + 1.0
    return s * s * s / 6.0, second / 6.0, third / 6.0, t * t * t / 6.0


@inlined
def _sums(t: float) -> Weights:
    """Integrals of ``_weights`` from the cell's beginning, over the cell."""
    s, q = 1.0 - t, t * t
    second = (0.75 * q * q - 2.0 * q * t + 4.0 * t) / 6.0
    third = (-0.75 * q * q + q * t + 1.5 * q + t) / 6.0
    return (1.0 - s**4) / 24.0, second, third, q * q / 24.0


@inlined
def _growth(t: float) -> Weights:
    """Derivatives of ``_weights``, per cell."""
    s = 1.0 - t
    return -0.5 * s * s, (1.5 * t - 2.0) * t, (1.0 - 1.5 * t) * t + 0.5, 0.5 * t * t


@inlined
def _place(value: float, lowest: float, cell: float, cells: int) -> tuple[int, float]:
    """Cell of a value, and its share of the cell; beyond all cells it counts as on their edge."""
    position = min(max((value - lowest) / cell, 0.0), float(cells))
    i = min(int(position), cells - 1)
    return i, position - i


@inlined
def _read(table: Array, i: int, j: int, along: Weights, across: Weights) -> float:
    total = 0.0
    for a in range(4):
        row = 0.0
        for b in range(4):
            row += across[b] * table[i + a, j + b]
        total += along[a] * row
    return total


@compiled
def change(table: Array, grid: Grid, u: float, w: float) -> float:
    """dw/du at a point, by the table of rising or of falling branches."""
    i, t = _place(u, grid[0], grid[1], table.shape[0] - 3)
    j, s = _place(w, grid[2], grid[3], table.shape[1] - 3)
    return float(_read(table, i, j, _weights(t), _weights(s)))


@compiled
def centre(curve: Centre, grid: Grid, u: float) -> tuple[float, float]:
    """Height (V) of the centre curve at an input, and its slope (V/V)."""
    slopes, heights = curve
    i, t = _place(u, grid[0], grid[1], len(slopes) - 3)
    part, weight, rise, slope = _sums(t), _weights(t), 0.0, 0.0
    for a in range(4):
        rise += part[a] * slopes[i + a]
        slope += weight[a] * slopes[i + a]
    return heights[i] + grid[1] * rise, slope


@compiled
def heights(curve: Centre, grid: Grid, inputs: Array) -> Array:
    """Heights (V) of the centre curve at inputs (V), both (n,)."""
    result = np.empty(inputs.size)
    for k in range(inputs.size):
        result[k] = centre(curve, grid, inputs[k])[0]
    return result


@compiled
def step(table: Array, grid: Grid, u: float, w: float, far: float) -> float:
    """W at the input ``far``, before which no stop lies, on the branch through (u, w)."""
    length = far - u
    half = u + 0.5 * length
    first = change(table, grid, u, w)
    second = change(table, grid, half, w + 0.5 * length * first)
    third = change(table, grid, half, w + 0.5 * length * second)
    last = change(table, grid, far, w + length * third)
    return float(w + length / 6.0 * (first + 2.0 * (second + third) + last))


@compiled
def next_stop(grid: Grid, u: float, way: float) -> float:
    """Return the first stop beyond an input, up (``way`` 1) or down (-1)."""
    pitch = grid[1] / STOPS
    stop = grid[0] + pitch * (np.floor(way * (u - grid[0]) / pitch) + 1.0) * way
    return float(stop if way * (stop - u) > 0.0 else stop + way * pitch)


@compiled
def by_input(tables: Array, curve: Centre, grid: Grid, now: Array, block: Array) -> Array:
    """Outputs (V) for a block of inputs (V), both (n,); ``now`` (input, w) is moved on."""
    result = np.empty(block.size)
    u, w = now
    for k in range(block.size):
        way = 1.0 if block[k] > u else -1.0
        table = tables[0] if way > 0.0 else tables[1]
        while u != block[k]:
            far = next_stop(grid, u, way)
            far = way * min(way * far, way * block[k])
            w = step(table, grid, u, w, far)
            u = far
        result[k] = centre(curve, grid, u)[0] + w
    now[0], now[1] = u, w
    return result


@compiled
def _solved(
    table: Array, curve: Centre, grid: Grid, at: tuple[float, float], stop: float, wanted: float
) -> tuple[float, float, float]:
    """Input on the branch from ``at`` (input, w) to a stop, its w, and what remains of ``wanted``.

    Newton's method between bounds that close in: the output grows all the way.
    """
    u, w = at
    height, slope = centre(curve, grid, u)
    way, near, far = np.sign(stop - u), u, stop
    exact = SOLVED * (curve[1][-1] - curve[1][0])
    found = u + (wanted - height - w) / (slope + change(table, grid, u, w))
    found = way * min(way * found, way * stop)
    remaining, there = 0.0, w
    for _ in range(TRIALS):
        there = step(table, grid, u, w, found)
        height, slope = centre(curve, grid, found)
        remaining = wanted - height - there
        if abs(remaining) <= exact or (found == stop and way * remaining > 0.0):
            break
        if way * remaining > 0.0:
            near = found
        else:
            far = found
        found += remaining / (slope + change(table, grid, found, there))
        if not way * near < way * found < way * far:
            found = 0.5 * (near + far)
    return found, there, remaining


@compiled
def by_output(
    tables: Array, curve: Centre, grid: Grid, now: Array, block: Array, result: Array
) -> tuple[int, float]:
    """Inputs (V) for a block of outputs (V), both (n,); ``now`` (input, w) is moved on.

    Returned are how many samples were done, and the output at the limit that the next one passes.
    """
    u, w = now
    limits = grid[0], grid[0] + grid[1] * (tables.shape[1] - 3)
    exact = SOLVED * (curve[1][-1] - curve[1][0])
    for k in range(block.size):
        height = centre(curve, grid, u)[0]
        remaining = block[k] - height - w
        way = 1.0 if remaining > 0.0 else -1.0
        table = tables[0] if way > 0.0 else tables[1]
        while not abs(remaining) <= exact:
            stop = min(max(next_stop(grid, u, way), limits[0]), limits[1])
            if not abs(remaining) < np.inf or stop == u:
                now[0], now[1] = u, w
                return k, float(block[k] - remaining)
            u, w, remaining = _solved(table, curve, grid, (u, w), stop, block[k])
        result[k] = u
    now[0], now[1] = u, w
    return block.size, 0.0


@compiled
def sensitivities(
    tables: Array, grid: Grid, now: Array, grown: Array, path: Array, known: Array
) -> tuple[Array, Array]:
    """Values of w along a path of inputs, (n,), and their derivatives by the tables, (n, values).

    ``now`` (input, w) and its derivatives ``grown`` (values,) are moved on.
    Where ``known`` (n,) is a number, the path goes on from it in place of w: the next value is then
    a prediction by one step alone.
    """
    cells, columns = (tables.shape[1] - 3, tables.shape[2] - 3), tables.shape[2]
    jacobian, values = np.empty((path.size, tables.size)), np.empty(path.size)
    u, w = now
    for k in range(path.size):
        way = 1.0 if path[k] > u else -1.0
        side = 0 if way > 0.0 else 1
        while u != path[k]:
            far = next_stop(grid, u, way)
            far = way * min(way * far, way * path[k])
            there = step(tables[side], grid, u, w, far)
            length = far - u
            i, t = _place(0.5 * (u + far), grid[0], grid[1], cells[0])
            j, s = _place(0.5 * (w + there), grid[2], grid[3], cells[1])
            along, across = _weights(t), _weights(s)
            bend = 0.5 * length * _read(tables[side], i, j, along, _growth(s)) / grid[3]
            grown *= (1.0 + bend) / (1.0 - bend)
            first = side * tables[0].size + i * columns + j
            for a in range(4):
                for b in range(4):
                    weight = length * along[a] * across[b] / (1.0 - bend)
                    grown[first + a * columns + b] += weight
            u, w = far, there
        jacobian[k], values[k] = grown, w
        if not np.isnan(known[k]):
            w = known[k]
            grown[:] = 0.0
    now[0], now[1] = u, w
    return values, jacobian
