"""The compiled branches of a Duhem operator: followed by input or by output, or differentiated.

Tables of uniform cubic B-splines over inputs u (V) and over w (V), the output's distance from the
centre curve c(u). On a branch dw/du = h(u, w), from stop to stop of a lattice by Runge and Kutta's
classical method. The stops are the same whatever the samples are, and none lies across a knot of
u: so a branch followed by output meets the one followed by input up to rounding.
"""

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from afm_scan_ros.core.compiled import compiled, inlined
from afm_scan_ros.core.types import Array

STOPS = 4
"""Steps of the integration in a cell of u."""
SOLVED = 1e-14
"""Share of the output's range to which an input is solved for."""
TRIALS = 100
"""Newton's steps, or halvings, at most; three are usual."""
SMALL = float(np.sqrt(np.finfo(np.float64).tiny))
"""Derivatives below this are forgotten: their products would underflow, which is slow."""
APART = float(np.sqrt(np.sqrt(np.finfo(np.float64).eps)))
"""Least scale of derivatives, or least inverse of it: their sums lose a quarter of all digits."""

Grid: TypeAlias = tuple[float, float, float, float]
"""Lowest input and its cell, lowest w and its cell, V."""
Centre: TypeAlias = tuple[Array, Array]
"""Coefficients of the centre curve's slope (V/V), and its heights (V) at the knots."""
Weights: TypeAlias = tuple[float, float, float, float]
Work: TypeAlias = tuple[NDArray[np.int64], Array]
"""Cells and splines of u and of w at the four points of a step, (4, 2) and (4, 2, 4)."""
Scaled: TypeAlias = tuple[Array, Array, Array]
"""Derivatives d, (values,), that share a scale s: s d, and their sum over samples is S d + r.

The three arrays are d, the rest r, (values,), and s with its sum S over the samples.
"""


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
    """Input on the branch from ``at`` towards a stop, its w, and what remains of ``wanted``."""
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
    """Inputs (V) for outputs (V), (n,): how many are done, and the limit that the next passes."""
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


@inlined
def _slope_and_bend(
    table: Array, grid: Grid, at: tuple[float, float], work: Work, stage: int
) -> tuple[float, float]:
    """Return ``change`` at (u, w) and its derivative by w, 0 beyond the cells; keep the splines."""
    (u, w), (places, splines) = at, work
    cells = table.shape[1] - 3
    i, t = _place(u, grid[0], grid[1], table.shape[0] - 3)
    j, s = _place(w, grid[2], grid[3], cells)
    along, across, growth = _weights(t), _weights(s), _growth(s)
    slope, bend = 0.0, 0.0
    for a in range(4):
        row, turn = 0.0, 0.0
        for b in range(4):
            row += across[b] * table[i + a, j + b]
            turn += growth[b] * table[i + a, j + b]
        slope += along[a] * row
        bend += along[a] * turn
        splines[stage, 0, a], splines[stage, 1, a] = along[a], across[a]
    places[stage, 0], places[stage, 1] = i, j
    inside = 0.0 < w - grid[2] < cells * grid[3]
    return slope, bend / grid[3] if inside else 0.0


@compiled
def _grow(
    tables: Array, side: int, grid: Grid, way: tuple[float, float, float], grown: Scaled, work: Work
) -> float:
    """Take one ``step`` from (u, w) to the input ``far``, and its derivatives by the tables.

    The shares of its four slopes in w at the end, each with what it does through those after it.
    """
    table, (u, w, far) = tables[side], way
    length = far - u
    half, end = 0.5 * length, length / 6.0
    k1, bend1 = _slope_and_bend(table, grid, (u, w), work, 0)
    k2, bend2 = _slope_and_bend(table, grid, (u + half, w + half * k1), work, 1)
    k3, bend3 = _slope_and_bend(table, grid, (u + half, w + half * k2), work, 2)
    k4, bend4 = _slope_and_bend(table, grid, (far, w + length * k3), work, 3)
    third = 2.0 * end + length * bend4 * end
    second = 2.0 * end + half * bend3 * third
    first = end + half * bend2 * second
    growth = 1.0 + first * bend1 + second * bend2 + third * bend3 + end * bend4
    _spread(grown, growth, (first, second, third, end), side, table.shape, work)
    return w + end * (k1 + 2.0 * (k2 + k3) + k4)


@inlined
def _spread(
    grown: Scaled, growth: float, shares: Weights, side: int, shape: tuple[int, int], work: Work
) -> None:
    """Let derivatives grow, by their scale, and add shares of the splines at four points."""
    derivatives, rest, scales = grown
    places, splines = work
    scales[0] *= growth
    if not APART < abs(scales[0]) < 1.0 / APART:
        _rescale(grown)
    first, rows = side * shape[0] * shape[1], shape[1]
    for stage in range(4):
        share = shares[stage] / scales[0]
        place = first + places[stage, 0] * rows + places[stage, 1]
        for a in range(4):
            for b in range(4):
                part = share * splines[stage, 0, a] * splines[stage, 1, b]
                derivatives[place + a * rows + b] += part
                rest[place + a * rows + b] -= scales[1] * part


@compiled
def _rescale(grown: Scaled) -> None:
    """Bring derivatives to a scale of one, and the rest of their sum to the whole of it."""
    derivatives, rest, scales = grown
    for m in range(derivatives.size):
        rest[m] += scales[1] * derivatives[m]
        value = scales[0] * derivatives[m]
        derivatives[m] = value if abs(value) > SMALL else 0.0
    scales[0], scales[1] = 1.0, 0.0


@compiled
def sensitivities(
    tables: Array, grid: Grid, now: Array, derivatives: Array, path: Array, known: Array
) -> tuple[Array, Array]:
    """Values of w along a path of inputs, (n,), and their derivatives by the tables, (n, values).

    ``now`` (input, w) and its ``derivatives`` are moved on. Where ``known`` (n,) is a number, the
    path goes on from it in place of w: the next value is a prediction by one step alone.
    """
    jacobian, values = np.empty((path.size, tables.size)), np.empty(path.size)
    grown = derivatives, np.zeros(tables.size), np.array([1.0, 0.0])
    work = np.empty((4, 2), np.int64), np.empty((4, 2, 4))
    for k in range(path.size):
        _follow(tables, grid, now, grown, work, path[k])
        _rescale(grown)
        jacobian[k], values[k] = derivatives, now[1]
        if not np.isnan(known[k]):
            now[1] = known[k]
            derivatives[:] = 0.0
    return values, jacobian


@compiled
def mean_sensitivities(
    tables: Array, grid: Grid, now: Array, derivatives: Array, path: Array, edges: NDArray[np.intp]
) -> Array:
    """Derivatives of ``sensitivities`` averaged between edges of a path: (edges - 1, values)."""
    mean, scales = np.zeros((edges.size - 1, tables.size)), np.array([1.0, 0.0])
    work = np.empty((4, 2), np.int64), np.empty((4, 2, 4))
    for k in range(mean.shape[0]):
        grown = derivatives, mean[k], scales
        for j in range(edges[k], edges[k + 1]):
            _follow(tables, grid, now, grown, work, path[j])
            scales[1] += scales[0]
        _rescale(grown)
        mean[k] /= edges[k + 1] - edges[k]
    return mean


@compiled
def _follow(tables: Array, grid: Grid, now: Array, grown: Scaled, work: Work, end: float) -> None:
    """Move (input, w) and its derivatives to an input."""
    u, w = now
    way = 1.0 if end > u else -1.0
    side = 0 if way > 0.0 else 1
    while u != end:
        far = next_stop(grid, u, way)
        far = way * min(way * far, way * end)
        w = _grow(tables, side, grid, (u, w, far), grown, work)
        u = far
    now[0], now[1] = u, w
