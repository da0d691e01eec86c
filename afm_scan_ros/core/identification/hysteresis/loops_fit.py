"""Records of loops of any kind → a Preisach model with the lag and creep that follow it.

Displacement = origin + Gc · G · H(u): H an Everett surface whose density is nowhere negative, G a
lag 1/(1 + s τ) behind the converter's hold, Gc one spring and damper of Eq. 1 (Croft, Shed and
Devasia 2001). For each lag and creep the density follows by non-negative least squares, so only
three numbers are searched for. They, and the density's smoothing, hardly depend on the grid and
are found on a coarse one.
"""

from collections.abc import Sequence
from functools import reduce
from operator import add
from typing import TypeAlias

import numpy as np
from attrs import frozen
from scipy.optimize import least_squares

from afm_scan_ros.core.cascade import Cascade
from afm_scan_ros.core.effects.creep import Creep, CreepModel
from afm_scan_ros.core.effects.vibration import Vibration, VibrationModel
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.hysteresis.loops import surface_of, swept_areas
from afm_scan_ros.core.identification.hysteresis.loops_model import LoopModel
from afm_scan_ros.core.identification.hysteresis.loops_weights import NormalEquations, solve
from afm_scan_ros.core.solver_status import require_converged
from afm_scan_ros.core.types import Array

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
