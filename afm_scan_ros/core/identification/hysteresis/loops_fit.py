"""Hysteresis, lag and creep of one axis whose records come from negative saturation.

Weights of the Preisach plane's cells, by regularised non-negative least squares.

Loops of any kind → the areas that they sweep in the Preisach plane.

Croft, Shed and Devasia (2001), Eqs. 11 and 12: the output is the integral of a density over all
relays that are switched up. With the density constant in each cell of a grid it is linear in the
cells' weights, and what multiplies them, the share of each cell that is switched, follows from
the drive alone. So a record needs no reversal curves to be told which weights made it.

Records of loops of any kind → a Preisach model with the lag and creep that follow it.

Displacement = origin + Gc · G · H(u): H an Everett surface whose density is nowhere negative, G a
lag 1/(1 + s τ) behind the converter's hold, Gc one spring and damper of Eq. 1 (Croft, Shed and
Devasia 2001). For each lag and creep the density follows by non-negative least squares, so only
three numbers are searched for. They, and the density's smoothing, hardly depend on the grid and
are found on a coarse one.
"""

import math
from collections.abc import Sequence
from functools import reduce
from operator import add
from typing import TypeAlias

import numpy as np
from attrs import frozen
from numpy.typing import NDArray
from scipy.linalg import cholesky, solve_triangular
from scipy.optimize import least_squares, nnls

from afm_scan_ros.core.cascade import Cascade, States
from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.effects.creep import Creep, CreepModel
from afm_scan_ros.core.effects.hysteresis.everett import EverettSurface, refuse_beyond
from afm_scan_ros.core.effects.hysteresis.preisach import Preisach
from afm_scan_ros.core.effects.hysteresis.walk import INPUT, OUTPUT, remember
from afm_scan_ros.core.effects.vibration import InverseDesign, Vibration, VibrationModel
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.solver_status import require_converged
from afm_scan_ros.core.types import Array


@frozen
class LoopModel:
    """Drive u (V) → hysteresis → F (V) → lag → creep → displacement (m), all at one sample period.

    The gauge: F runs from 0 at negative saturation over as many volts as the drive. So a record
    that comes from negative saturation comes from rest, and displacement is counted from there.
    """

    surface: EverettSurface
    vibration: VibrationModel
    creep: CreepModel
    sample_period: float

    def apply(self, drive: Array) -> Array:
        """Displacement (m) under a drive (V), both (n,)."""
        cascade = self._cascade()
        states = self._saturated(cascade.at_rest())
        return cascade.apply(states, drive)[1]

    def invert(self, displacement: Array, design: InverseDesign) -> Array:
        """Drive (V) for a displacement (m), both (n,). Raises BeyondRangeError out of range."""
        cascade = self._cascade(design)
        states = self._saturated(cascade.inverse_at_rest())
        states, drive = cascade.invert(states, displacement)
        return np.concatenate((drive, cascade.finish(states)))

    def _cascade(self, design: InverseDesign | None = None) -> Cascade:
        return Cascade(
            (
                Preisach(self.surface),
                Vibration(self.vibration, self.sample_period, design),
                Creep(self.creep, self.sample_period),
            )
        )

    def _saturated(self, states: States) -> States:
        return (Preisach(self.surface).saturated(), *states[1:])


Indices: TypeAlias = NDArray[np.int64]

REVERSIBLE = 0.01
"""Least weight of all cells on the diagonal, in rms displacements: it gives an inverse."""
ROUNDING = 1e-12
"""Share of the equations' trace that keeps them positive definite where nothing was swept."""


@frozen(eq=False)
class NormalEquations:
    """What a stretch of record says of the weights; two stretches say the sum.

    ``gram`` AᵀA (p, p), ``moment`` Aᵀy (p,) in m, ``energy`` yᵀy in m².
    """

    gram: Array
    moment: Array
    energy: float
    samples: int

    @classmethod
    def of(cls, areas: Array, displacement: Array) -> "NormalEquations":
        """Take areas A (n, p) and the displacement y (n,), m."""
        energy = float(displacement @ displacement)
        return cls(areas.T @ areas, areas.T @ displacement, energy, len(displacement))

    def __add__(self, other: "NormalEquations") -> "NormalEquations":
        return NormalEquations(
            self.gram + other.gram,
            self.moment + other.moment,
            self.energy + other.energy,
            self.samples + other.samples,
        )

    def rms(self, weights: Array) -> float:
        """Root of the mean square, m, that these weights leave."""
        return float(np.sqrt(self.squares(weights) / self.samples))

    def squares(self, weights: Array) -> float:
        """Sum of the squares, m², that these weights leave."""
        return float(self.energy + weights @ (self.gram @ weights - 2.0 * self.moment))


def solve(equations: NormalEquations, smoothing: float) -> Array:
    """Weights (m), shape (p,), none negative.

    Least is the mean square misfit plus ``smoothing`` times the mean square slope of the density,
    over alpha and beta from 0 to 1; so one smoothing serves every size of the grid.
    """
    cells = side(len(equations.moment))
    least = np.zeros_like(equations.moment)
    least[_diagonal(cells)] = REVERSIBLE * np.sqrt(equations.energy / equations.samples) / cells
    matrix = equations.gram / equations.samples + smoothing * roughness(cells)
    matrix += ROUNDING * np.trace(matrix) * np.eye(len(matrix))
    root = cholesky(matrix, lower=True)
    moment = equations.moment / equations.samples - matrix @ least
    above = nnls(root.T, solve_triangular(root, moment, lower=True), maxiter=20 * len(root))[0]
    return np.asarray(least + above)


def roughness(cells: int) -> Array:
    """Quadratic form of the density's differences between neighbours, shape (p, p).

    The diagonal, where thresholds are equal, has a density of its own, along a line.
    """
    count = cell_count(cells)
    index = np.zeros((cells, cells), dtype=np.int64)
    index[np.tril_indices(cells)] = np.arange(count)
    below = np.tri(cells, k=-1, dtype=bool)
    along_alpha = index[:-1][below[:-1]], index[1:][below[:-1]]
    along_beta = index[:, :-1][below[:, 1:]], index[:, 1:][below[:, 1:]]
    on_diagonal = _diagonal(cells)[:-1], _diagonal(cells)[1:]
    return cells**4 * (
        _differences(count, *along_alpha) + _differences(count, *along_beta)
    ) + cells**3 * _differences(count, *on_diagonal)


def _differences(count: int, first: Indices, second: Indices) -> Array:
    """Quadratic form Σ (w[second] - w[first])²."""
    steps = np.zeros((len(first), count))
    steps[np.arange(len(first)), first] = -1.0
    steps[np.arange(len(first)), second] = 1.0
    return steps.T @ steps


def _diagonal(cells: int) -> Indices:
    numbers = np.arange(1, cells + 1)
    return numbers * (numbers + 1) // 2 - 1


def cell_count(cells: int) -> int:
    """Return how many cells a grid of ``cells`` a side has where alpha ≥ beta."""
    return cells * (cells + 1) // 2


def side(count: int) -> int:
    """Return how many cells a side a grid has that has ``count`` of them where alpha ≥ beta."""
    return (math.isqrt(8 * count + 1) - 1) // 2


def swept_areas(drive: Array, lower: float, upper: float, cells: int) -> Array:
    """Share of each cell that is switched up, times two, shape (n, cell_count(cells)).

    The drive, V, shape (n,), comes from ``lower``, the negative saturation, where all is down.
    Columns run along alpha, within it along beta up to the diagonal; the cells on it hold relays
    whose two thresholds are one. Raises BeyondRangeError for a sample out of the range.
    """
    refuse_beyond(drive, lower, upper)
    rows = np.zeros((len(drive) + 1, cell_count(cells)))
    stack = np.zeros((2, len(drive) + 1))
    _sweep((drive - lower) * (cells / (upper - lower)), stack, rows)
    return rows[1:]


def surface_of(weights: Array, lower: float, upper: float, offset: float) -> EverettSurface:
    """Everett surface whose cells hold these weights, in the order of ``swept_areas``' columns.

    E(alpha, beta) is the sum over all cells between beta and alpha. Raises InputError where a
    weight on the diagonal is not positive and the surface has no inverse.
    """
    cells = side(len(weights))
    density = np.zeros((cells, cells))
    density[np.tril_indices(cells)] = weights
    values = np.zeros((cells + 1, cells + 1))
    values[1:, :-1] = np.cumsum(np.cumsum(density, axis=0)[:, ::-1], axis=1)[:, ::-1]
    return EverettSurface(lower, upper, np.tril(values), offset)


@compiled
def _sweep(drive: Array, stack: Array, rows: Array) -> None:
    """Fill row k + 1 for sample k; the stack's second line holds the extrema's rows."""
    now, depth = np.zeros(2), 1
    for k in range(len(drive)):
        depth = remember(stack, depth, now, INPUT, drive[k])
        base = stack[INPUT, depth - 1]
        rows[k + 1] = rows[int(stack[OUTPUT, depth - 1])]
        if depth % 2 == 1:
            _switch(rows[k + 1], base, drive[k], 2.0)
        else:
            _switch(rows[k + 1], drive[k], base, -2.0)
        now[INPUT], now[OUTPUT] = drive[k], k + 1


@compiled
def _switch(row: Array, below: float, above: float, change: float) -> None:
    """Add ``change`` times the share of each cell that lies between two levels (in cells)."""
    for i in range(int(below), int(np.ceil(above))):
        first = i * (i + 1) // 2
        alpha = min(above - i, 1.0)
        for j in range(int(below), i):
            row[first + j] += change * alpha * min(j + 1.0 - below, 1.0)
        row[first + i] += change * max(alpha + min(i + 1.0 - below, 1.0) - 1.0, 0.0)


COARSE = 12
"""Cells a side of the grid on which lag, creep and smoothing are sought."""
SMOOTHINGS = tuple(10.0**exponent for exponent in range(-9, -2))
"""Smoothings to choose from."""
SEEKING = 1e-6
"""Smoothing under which lag and creep are sought."""
LAGS = np.array([0.1, 2.0, 50.0])
"""Least, first and greatest lag sought, in samples."""
GAINS = np.array([0.0, 0.02, 0.5])
"""Least, first and greatest gain of the creep."""
CREEPS = np.array([0.01, 0.2, 1.0])
"""Least, first and greatest time constant of the creep, in lengths of the longest record."""

Stretch: TypeAlias = tuple[Array, Array]
"""Areas behind lag and creep, (n, p), and displacement, m, (n,), means removed."""


@frozen(eq=False)
class LoopRecord:
    """Drive (V) and displacement (m), both (n,), of a scanner coming from negative saturation.

    Only the stretches ``taught`` teach. Each has an origin of its own, which is not fitted: the
    mean over the stretch is removed. Raises InputError for unequal lengths, for values that are
    not finite, and for a stretch over which the displacement rests.
    """

    drive: Array
    displacement: Array
    taught: tuple[slice, ...]

    def __attrs_post_init__(self) -> None:
        drive, displacement = self.drive, self.displacement
        if drive.shape != displacement.shape:
            raise InputError(
                f"loops: {len(drive)} samples of drive, {len(displacement)} of displacement; give"
                " both of one record"
            )
        if not np.isfinite([drive, displacement]).all():
            sample = int(np.argmin(np.isfinite([drive, displacement]).all(axis=0)))
            raise InputError(f"loops: sample {sample} is not finite; record it again")
        for part in self.taught:
            if displacement[part].size == 0 or np.ptp(displacement[part]) == 0.0:
                raise InputError(
                    f"loops: the displacement rests from sample {part.start} to {part.stop}; let a"
                    " stretch that moves teach"
                )


@frozen
class LoopRange:
    """The drive's range, V, negative saturation first, and the grid's cells a side."""

    lower: float
    upper: float
    cells: int = 50


@frozen
class LoopFit:
    """The model, the smoothing chosen, and rms misfits in m.

    ``fitted`` is to all that taught. ``crossed`` is that of each stretch under what the others
    taught, on the coarse grid; it chose the smoothing.
    """

    model: LoopModel
    smoothing: float
    fitted: float
    crossed: float


def fit_loops(records: Sequence[LoopRecord], sample_period: float, span: LoopRange) -> LoopFit:
    """Fit all that teaches.

    Raises InputError for fewer than two stretches, BeyondRangeError for a drive out of the range.
    """
    stretches = sum(len(record.taught) for record in records)
    if stretches < 2:  # noqa: PLR2004 - one teaches, another judges the smoothing
        raise InputError(
            f"loops: {stretches} stretch to learn from; give two or more, of unlike amplitudes,"
            " so that each can be predicted from the others"
        )
    swept = _swept(records, span, COARSE)
    linear = _seek(records, swept, sample_period)
    smoothing, crossed = _cross_validate(_equations(linear.stretches(records, swept)))
    whole = reduce(add, _equations(linear.stretches(records, _swept(records, span, span.cells))))
    weights = solve(whole, smoothing)
    return LoopFit(linear.model(weights, span), smoothing, whole.rms(weights), crossed)


def _swept(records: Sequence[LoopRecord], span: LoopRange, cells: int) -> list[Array]:
    return [swept_areas(record.drive, span.lower, span.upper, cells) for record in records]


def _equations(stretches: Sequence[Stretch]) -> list[NormalEquations]:
    return [NormalEquations.of(*stretch) for stretch in stretches]


@frozen
class _Linear:
    """What follows the hysteresis: a lag, s, then creep."""

    lag: float
    creep: CreepModel
    sample_period: float

    def stretches(self, records: Sequence[LoopRecord], swept: Sequence[Array]) -> list[Stretch]:
        """Areas as the displacement shows them, and the displacement, wherever it teaches."""
        vibration = Vibration(VibrationModel((1.0,), (self.lag, 1.0)), self.sample_period)
        effects = Cascade((vibration, Creep(self.creep, self.sample_period)))
        found = []
        for record, areas in zip(records, swept, strict=True):
            cells = [effects.apply(effects.at_rest(), cell)[1] for cell in areas.T]
            shown = np.column_stack(cells)
            found += [
                (_centred(shown[part]), _centred(record.displacement[part]))
                for part in record.taught
            ]
        return found

    def model(self, weights: Array, span: LoopRange) -> LoopModel:
        """Fix the gauge: F runs over as many volts as the drive."""
        gain = 2.0 * float(weights.sum()) / (span.upper - span.lower)
        return LoopModel(
            surface_of(weights / gain, span.lower, span.upper, offset=0.0),
            VibrationModel((gain,), (self.lag, 1.0)),
            self.creep,
            self.sample_period,
        )


def _centred(values: Array) -> Array:
    return np.asarray(values - values.mean(axis=0))


def _seek(records: Sequence[LoopRecord], swept: Sequence[Array], sample_period: float) -> _Linear:
    """Lag, creep gain and creep constant whose best density misses the displacement least."""
    longest = max(len(record.drive) for record in records)
    lags = np.log(sample_period * LAGS)
    constants = np.log(sample_period * longest * CREEPS)

    def linear(sought: Array) -> _Linear:
        creep = CreepModel((sought[1],), (np.exp(sought[2]),))
        return _Linear(float(np.exp(sought[0])), creep, sample_period)

    def residual(sought: Array) -> Array:
        stretches = linear(sought).stretches(records, swept)
        weights = solve(reduce(add, _equations(stretches)), SEEKING)
        misses = np.concatenate([moved - areas @ weights for areas, moved in stretches])
        return np.asarray(misses / np.sqrt(sum(moved @ moved for _, moved in stretches)))

    lowest, first, highest = np.column_stack([lags, GAINS, constants])
    found = least_squares(residual, first, bounds=(lowest, highest), diff_step=1e-3, xtol=1e-3)
    return linear(require_converged(found, "hysteresis of loops"))


def _cross_validate(equations: Sequence[NormalEquations]) -> tuple[float, float]:
    """Smoothing under which the stretches predict each other best, and how well, m rms."""
    return min((_crossed(equations, choice), choice) for choice in SMOOTHINGS)[::-1]


def _crossed(equations: Sequence[NormalEquations], smoothing: float) -> float:
    squares = 0.0
    for k, left_out in enumerate(equations):
        others = [*equations[:k], *equations[k + 1 :]]
        squares += left_out.squares(solve(reduce(add, others), smoothing))
    return float(np.sqrt(squares / sum(stretch.samples for stretch in equations)))
