"""Records of motion → the vibration and the creep behind the hysteresis, as far as identifiable.

Displacement = origin + Gc · G · H(u). For each G and Gc the density of H follows by non-negative
least squares, so that few numbers are searched for (variable projection). They hardly depend on
the grid of the density and are found on a coarse one. A resonance shows by its ripple in all that
moves: no free decay is asked for, as images show no turns.
"""

from collections.abc import Sequence
from typing import TypeAlias

import numpy as np
from attrs import evolve, frozen
from scipy.optimize import least_squares
from scipy.signal import argrelmin

from afm_scan_ros.core.arguments import require_converged
from afm_scan_ros.core.effects.creep import CreepModel
from afm_scan_ros.core.effects.vibration import VibrationModel
from afm_scan_ros.core.fit.likeness import jackknife
from afm_scan_ros.core.fit.noise import correlation_length
from afm_scan_ros.core.model import ParameterInterval, closed
from afm_scan_ros.core.types import Array
from afm_scan_ros.features.images.loops.density import solve
from afm_scan_ros.features.images.loops.moving import (
    LinearDynamics,
    LoopPart,
    MovingRecord,
    Swept,
    parts_of,
)

LAGS = np.array([0.1, 2.0, 50.0])
"""Least, first and greatest lag sought, in samples of the fastest record."""
GAINS = np.array([0.0, 0.02, 0.5])
"""Least, first and greatest gain of the creep."""
CREEPS = np.array([0.01, 0.2, 1.0])
"""Least, first and greatest time constant of the creep, in lengths of the longest record."""
RATIO = 1.06
"""Ratio of neighbouring frequencies that are tried."""
DAMPINGS = np.log([1e-3, 0.02, 0.5])
"""Least, first and greatest logarithm of the damping ratio."""
QUADRATIC = 3.0
"""Difference of two grids over the error of the finer one, of half the width."""
FARTHEST = np.log(1e3)
"""Logarithm of the factor from which on an interval counts as open."""
NO_CREEP = CreepModel((), ())


def at_once(gain: float, period: float) -> VibrationModel:
    """Vibration of a gain that is too fast for samples of a ``period`` (s) to show."""
    return VibrationModel((gain,), (float(LAGS[0]) * period, 1.0))


class Lag:
    """G = 1/(1 + s τ), of the logarithm of τ."""

    def __init__(self, records: Sequence[MovingRecord]) -> None:
        lags = LAGS * min(one.sample_period for one in records)
        fastest = max(one.swings for one in records)
        lags[-1] = max(lags[-1], 1.0 / (2.0 * np.pi * fastest))
        self.bounds = np.log(lags)[:, np.newaxis]

    def put(self, dynamics: LinearDynamics, values: Array) -> LinearDynamics:
        """Put the lag in the vibration's place."""
        return evolve(dynamics, vibration=VibrationModel((1.0,), (float(np.exp(values[0])), 1.0)))

    def intervals(self, values: Array, half: Array) -> tuple[ParameterInterval, ...]:
        """Interval of the lag."""
        return (of_logarithm("lag", values[0], half[0], "s"),)

    def identified(self, values: Array, half: Array) -> bool:  # noqa: ARG002 - as of every form
        """Whether the lag is not below any that shows."""
        return bool(half[0] < 1.0)


class OneCreep:
    """One spring and damper, Gc = 1 + g/(1 + s τ), of g and the logarithm of τ."""

    def __init__(self, records: Sequence[MovingRecord]) -> None:
        longest = max(len(one.drive) * one.sample_period for one in records)
        self.bounds = np.column_stack([GAINS, np.log(longest * CREEPS)])

    def put(self, dynamics: LinearDynamics, values: Array) -> LinearDynamics:
        """Put the creep in its place."""
        return evolve(dynamics, creep=CreepModel((values[0],), (float(np.exp(values[1])),)))

    def intervals(self, values: Array, half: Array) -> tuple[ParameterInterval, ...]:
        """Intervals of gain and time constant (s)."""
        gain, reach = float(values[0]), float(half[0])
        return (
            closed("gain_1", (gain - reach, gain + reach), "1"),
            of_logarithm("time_constant_1", values[1], half[1], "s"),
        )

    def identified(self, values: Array, half: Array) -> bool:
        """Whether the gain is above zero."""
        return bool(values[0] > half[0])


class ResonanceForm:
    """G = 1/(1 + 2ζs/ω + s²/ω²), of the logarithms of ω near a first one (Hz), and of ζ."""

    def __init__(self, hertz: float) -> None:
        first = np.log(2.0 * np.pi * hertz)
        near = 2.0 * np.log(RATIO)
        self.bounds = np.column_stack([[first - near, first, first + near], DAMPINGS])

    def put(self, dynamics: LinearDynamics, values: Array) -> LinearDynamics:
        """Put the resonance in the vibration's place."""
        omega, zeta = (float(each) for each in np.exp(values))
        mode = VibrationModel((1.0,), (1.0 / omega**2, 2.0 * zeta / omega, 1.0))
        return evolve(dynamics, vibration=mode)

    def intervals(self, values: Array, half: Array) -> tuple[ParameterInterval, ...]:
        """Intervals of frequency (Hz) and damping (1)."""
        hertz = float(values[0] - np.log(2.0 * np.pi))
        return (
            of_logarithm("resonance", hertz, half[0], "Hz"),
            of_logarithm("damping", values[1], half[1], "1"),
        )

    def identified(self, values: Array, half: Array) -> bool:  # noqa: ARG002 - as of every form
        """Whether the frequency is known as finely as it was tried."""
        return bool(half[0] < np.log(RATIO))


Form: TypeAlias = Lag | OneCreep | ResonanceForm
"""A vibration or a creep of some numbers; ``bounds`` (3, numbers): least, first, greatest."""


@frozen(eq=False)
class Found:
    """Dynamics that were found, which of the forms the records identify, and with what intervals.

    The intervals follow from how much the pieces of the records disagree (the jackknife
    with clusters), so that they hold model error as well as noise.
    """

    dynamics: LinearDynamics
    values: Array
    """Numbers of the forms, one after the other."""
    identified: tuple[bool, ...]
    intervals: tuple[tuple[ParameterInterval, ...], ...]
    residual: Array
    """Relative to the displacement's rms, row by row of all records that are fitted."""


@frozen(eq=False)
class Densities:
    """Records under the density, of a ``smoothing``, that is best for the dynamics tried."""

    records: Sequence[Swept]
    smoothing: float

    def residual(self, dynamics: LinearDynamics) -> Array:
        """Residual of the best density, each row times the root of its samples."""
        whole = LoopPart.together([one.whole(dynamics) for one in self.records])
        missed = whole.moved - whole.areas @ solve(whole.equations, self.smoothing)
        return np.asarray(missed / np.linalg.norm(whole.moved))

    def pieces(self) -> Sequence[slice]:
        """Parts of each record, counted through all."""
        return parts_of([int(np.count_nonzero(one.measured)) for one in self.records])


def search(
    evidence: Densities, known: LinearDynamics, forms: Sequence[Form], coarser: Array | None = None
) -> Found:
    """Search for the forms that miss the displacement least; the rest is known.

    ``coarser`` are the numbers that a grid of cells twice as wide gave: the search begins there,
    and the intervals reach to where cells of no width would lead, as their error is quadratic.

    Raises ScanError where the search does not converge.
    """

    def dynamics(values: Array, without: Form | None = None) -> LinearDynamics:
        result = known
        for form, part in zip(forms, _parts(values, forms), strict=True):
            result = result if form is without else form.put(result, part)
        return result

    def residual(values: Array) -> Array:
        return evidence.residual(dynamics(values))

    if not forms:
        return Found(known, np.empty(0), (), (), evidence.residual(known))
    lowest, first, highest = np.hstack([form.bounds for form in forms])
    first = first if coarser is None else coarser
    found = least_squares(residual, first, bounds=(lowest, highest), diff_step=1e-3, xtol=1e-3)
    best = require_converged(found, "vibration and creep of records")
    half = jackknife(evidence.pieces(), found.jac, found.fun)
    if coarser is not None:
        half = half + np.abs(best - coarser) / QUADRATIC
    reach = np.where(found.active_mask == 0, half, np.inf)  # at a bound the best may lie beyond
    each = list(zip(forms, *(_parts(v, forms) for v in (best, half, reach)), strict=True))
    return Found(
        dynamics(best),
        best,
        tuple(
            form.identified(values, wide)
            and _serves(found.fun, evidence.residual(dynamics(best, form)), len(values))
            for form, values, wide, _ in each
        ),
        tuple(form.intervals(values, wide) for form, values, _, wide in each),
        found.fun,
    )


def _serves(residual: Array, without: Array, numbers: int) -> bool:
    """Whether a form of some ``numbers`` explains more than it costs, by Schwarz's criterion.

    Residuals that neighbouring rows have in common count once.
    """
    count = len(residual) / correlation_length(residual)
    gain = count * np.log((without @ without) / (residual @ residual))
    return bool(gain > numbers * np.log(count))


def _parts(values: Array, forms: Sequence[Form]) -> list[Array]:
    """Numbers of each form."""
    return np.split(values, np.cumsum([form.bounds.shape[1] for form in forms])[:-1])


def of_logarithm(name: str, value: float, half: float, unit: str) -> ParameterInterval:
    """Interval of a number whose logarithm was sought, open where that may be anything."""
    if half > FARTHEST:
        return ParameterInterval(name, unit)
    return closed(name, (float(np.exp(value - half)), float(np.exp(value + half))), unit)


BEST = 3
"""Frequencies tried from which a search begins."""
CYCLES = 3.0
"""Fewest cycles in a swing, as a loop bends less often."""
ROWS_A_CYCLE = 4.0
"""Fewest rows of a cycle that show it."""


def rippling(swept: Sequence[Swept], smoothing: float, known: LinearDynamics) -> Found | None:
    """Resonance of gain 1 at rest; None where the records do not identify it.

    Raises ScanError where a search does not converge.
    """
    evidence = Densities(swept, smoothing)
    tried = _tried([one.record for one in swept], min(one.row_period for one in swept))
    misses = np.array([_missed(evidence, known, float(hertz)) for hertz in tried])
    places = sorted(argrelmin(misses, mode="clip")[0], key=lambda place: misses[place])[:BEST]
    found = [search(evidence, known, [ResonanceForm(float(tried[place]))]) for place in places]
    seen = (each for each in found if all(each.identified))
    return min(seen, key=lambda each: float(each.residual @ each.residual), default=None)


def _tried(records: Sequence[MovingRecord], row_period: float) -> Array:
    """Frequencies (Hz) of enough cycles in the fastest swing, and of rows enough in a cycle."""
    lowest = CYCLES * max(one.swings for one in records)
    highest = max(1.0 / (ROWS_A_CYCLE * row_period), lowest)
    return np.asarray(
        np.geomspace(lowest, highest, 1 + int(np.log(highest / lowest) / np.log(RATIO)))
    )


def _missed(evidence: Densities, known: LinearDynamics, hertz: float) -> float:
    form = ResonanceForm(hertz)
    residual = evidence.residual(form.put(known, form.bounds[1]))
    return float(residual @ residual)
