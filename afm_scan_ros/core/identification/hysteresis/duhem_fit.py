"""A slow record → the slopes of a Duhem operator that predicts it best.

Smoothness: third differences of the splines' coefficients are a priori normal, of one variance. Its
ratio to the noise's is that of most evidence (restricted maximum likelihood). Two branches of one
kind never move apart, as no loop would settle then: slopes do not grow along w where they rise, and
do not fall where they fall. So is the extrapolation to where no branch came. Source: P. H. C.
Eilers and B. D. Marx, Statistical Science 11 (1996) 89; S. N. Wood, J. Royal Statistical Society B
73 (2011) 3, Eq. 4; C. L. Lawson and R. J. Hanson, Solving Least Squares Problems, 1974, chapter 23.

The fit is first by equation error: each point of the record is predicted from the one before as
measured. Then by output error: the whole record is predicted from its start, so that noise in F, of
which the slopes are functions, does not bend them. Both are least squares by Gauss and Newton's
method.
"""

from itertools import pairwise
from typing import TypeAlias

import numpy as np
from attrs import evolve, field, frozen
from numpy.typing import NDArray
from scipy.linalg import block_diag, cho_factor, cho_solve, solve_triangular
from scipy.optimize import minimize_scalar, nnls

from afm_scan_ros.core.effects.hysteresis.branches import sensitivities
from afm_scan_ros.core.effects.hysteresis.duhem import Duhem, DuhemSlopes
from afm_scan_ros.core.effects.hysteresis.preisach import depolarising
from afm_scan_ros.core.identification.hysteresis.reversal_curves import turning_points
from afm_scan_ros.core.types import Array

ORDER = 3
"""Order of the differences that are a priori small: Duhem's own equation is linear in F."""
WEAKEST, STRONGEST = -12.0, 2.0
"""Exponents of ten of the prior's strength, over the data's, between which evidence decides."""


@frozen(eq=False)
class SmoothnessEvidence:
    """Normal equations of the data, of (rising, falling) slopes, and of the prior.

    At a strength of 1 both weigh alike. ``square`` is the sum of the squared data of so many
    ``points``, ``rank`` that of the prior, ``shape`` that of both tables.
    """

    data: Array
    prior: Array
    given: Array
    square: float
    points: int
    rank: int
    shape: tuple[int, ...]

    @classmethod
    def of(cls, matrix: Array, given: Array, shape: tuple[int, ...]) -> "SmoothnessEvidence":
        """Take equations for slopes of such a ``shape``, (n, slopes) and (n,)."""
        _, rows, columns = shape
        rough, data = np.kron(np.eye(2), _roughness(rows, columns)), matrix.T @ matrix
        prior = np.asarray(rough * (np.trace(data) / np.trace(rough)))
        rank = 2 * (rows * columns - ORDER**2)
        return cls(data, prior, matrix.T @ given, float(given @ given), len(given), rank, shape)

    def best(self) -> float:
        """Strength of most evidence."""
        found = minimize_scalar(
            self._lacking, bounds=(WEAKEST, STRONGEST), method="bounded", options={"xatol": 0.1}
        )
        return float(10.0**found.x)

    def _lacking(self, exponent: float) -> float:
        """Minus twice the logarithm of the evidence, but for a constant."""
        factor = cho_factor(self.data + 10.0**exponent * self.prior, lower=True)
        residual = self.square - self.given @ cho_solve(factor, self.given)
        free = self.points - (len(self.given) - self.rank)
        volume = 2.0 * np.log(np.diag(factor[0])).sum()
        return float(free * np.log(residual) + volume - self.rank * np.log(10.0) * exponent)

    def solved(self, strength: float, least: float) -> Array:
        """Most probable slopes of at least ``least``, whose branches never move apart."""
        normal = self.data + strength * self.prior
        sums = _sums_across(self.shape)
        factor = np.linalg.cholesky(sums.T @ normal @ sums)
        given = sums.T @ (self.given - normal @ np.full(len(normal), least))
        rises, _ = nnls(factor.T, solve_triangular(factor, given, lower=True))
        return np.asarray((least + sums @ rises).reshape(self.shape))


def _sums_across(shape: tuple[int, ...]) -> Array:
    """Slopes above the least from their rises, which go down on rising branches, else up."""
    _, rows, columns = shape
    falling = np.tri(columns)
    return np.asarray(block_diag(*[falling.T] * rows, *[falling] * rows))


def _roughness(rows: int, columns: int) -> Array:
    """Sum of squared third differences along either side of a table, per extent of that side."""

    def along(size: int, other: int) -> Array:
        third = np.diff(np.eye(size), n=ORDER, axis=0)
        return np.asarray(third.T @ third * float(size - 3) ** (2 * ORDER - 1) / (other - 3))

    each = np.kron(along(rows, columns), np.eye(columns))
    return np.asarray(each + np.kron(np.eye(rows), along(columns, rows)))


CELLS = 12
"""Cells of the splines along either side: more than the evidence makes use of."""
POINTS = 8
"""Points of a branch per cell of u that are kept, each the average of its surroundings."""
MARGIN = 0.05
"""Share of the outputs' distances from the centre by which the splines reach beyond them."""
LEAST = 0.01
"""Least slope, over the mean one."""
STEPS, SETTLED = 8, 1e-3
"""Steps of the output error at most; relative change of its rms to stop at."""
SHARES = (1.0, 0.5, 0.25)
"""Of a step, the first that lessens the error is taken."""

Mask: TypeAlias = NDArray[np.bool_]


@frozen(eq=False)
class Branches:
    """A record's branches, thinned, from ``start``, (input, output) in V.

    ``inputs`` and ``outputs``, both (n,), in V; an output is NaN where the drive turns. ``counts``
    is how many samples each is the average of.
    """

    start: tuple[float, float]
    inputs: Array
    outputs: Array
    counts: Array

    @classmethod
    def of(cls, drive: Array, effective: Array, pitch: float) -> "Branches":
        """Take stretches of ``pitch`` (V) from drive and F (V), both (n,)."""
        still = int(np.argmax(drive != drive[0]))
        start = float(drive[0]), float(np.mean(effective[: max(still, 1)]))
        ends = np.concatenate([[max(still - 1, 0)], turning_points(drive), [len(drive) - 1]])
        parts = [_thinned(drive[a : b + 1], effective[a : b + 1], pitch) for a, b in pairwise(ends)]
        return cls(start, *(np.concatenate(each) for each in zip(*parts, strict=True)))

    @property
    def seen(self) -> Mask:
        """Where there is an output."""
        return self.counts > 0.0


def _thinned(inputs: Array, outputs: Array, pitch: float) -> tuple[Array, Array, Array]:
    """Averages over stretches of one branch, and its end, whose output is left out."""
    way = np.abs(inputs - inputs[0])
    stretches = max(int(way[-1] / pitch), 1)
    place = np.minimum((way / way[-1] * stretches).astype(np.int64), stretches - 1)
    count = np.bincount(place).astype(np.float64)
    held = count > 0.0
    means = (np.bincount(place, signal)[held] / count[held] for signal in (inputs, outputs))
    ends = inputs[-1], np.nan, 0.0
    u, f, counts = (
        np.append(part, end) for part, end in zip((*means, count[held]), ends, strict=True)
    )
    return u, f, counts


@frozen(eq=False)
class FittedSlopes:
    """Slopes, and the ``strength`` of the prior over the data's; ``noise`` (V) is the residual."""

    slopes: DuhemSlopes
    strength: float
    noise: float
    branches: Branches = field(repr=False)

    @property
    def operator(self) -> Duhem:
        """The effect from drive to effective input."""
        return Duhem(self.slopes)

    @property
    def scatter(self) -> float:
        """Residual of the outputs, over their range."""
        return self.noise / float(np.ptp(self.branches.outputs))

    def change_from(self, before: "FittedSlopes") -> float:
        """Largest change of an output on the branches from another fit's, over their range."""
        output = self.predicted()
        return float(np.abs(output - before.predicted()).max() / np.ptp(output))

    def predicted(self) -> Array:
        """Outputs (V) on the branches that it was fitted to."""
        effect, start = Duhem(self.slopes), _begin(self.slopes, self.branches)
        return effect.apply(np.array(start), self.branches.inputs)[1]


def fit_duhem(drive: Array, effective: Array, cells: int = CELLS) -> FittedSlopes:
    """Fit the slopes to a drive u and an effective input F (V), both (n,), from its first sample.

    F is freed of creep and vibration; the scanner is depolarised where the drive begins at 0 V.
    """
    pitch = float(np.ptp(drive)) / (cells * POINTS)
    branches = Branches.of(drive, effective, pitch)
    centred = _centred(branches, cells)
    near = _solved(centred, branches, branches.outputs, None)
    return _refined(near, None)


def refit(before: FittedSlopes, drive: Array, effective: Array) -> FittedSlopes:
    """Fit again to another F of the same drive, with the prior as strong."""
    cells = len(before.slopes.centre) - 3
    pitch = float(np.ptp(drive)) / (cells * POINTS)
    branches = Branches.of(drive, effective, pitch)
    return _refined(evolve(before, branches=branches), before.strength)


def _refined(fitted: FittedSlopes, strength: float | None) -> FittedSlopes:
    """Go on by output error until its rms settles; evidence decides at the first step."""
    blind, error = np.full_like(fitted.branches.outputs, np.nan), _error(fitted)
    for _ in range(STEPS):
        found = _solved(fitted.slopes, fitted.branches, blind, strength)
        strength, before = found.strength, error
        for share in SHARES:
            tried = evolve(found, slopes=_between(fitted.slopes, found.slopes, share))
            if (error := _error(tried)) < before:
                break
        if not error < before:
            break
        fitted = evolve(tried, noise=error)
        if before - error <= SETTLED * before:
            break
    return _depolarised(fitted)


def _depolarised(fitted: FittedSlopes) -> FittedSlopes:
    """Know the depolarised state where the record begins in it, or else by an oscillation."""
    slopes, (first, output) = fitted.slopes, fitted.branches.start
    if first != 0.0:
        fading = depolarising(slopes.lower, slopes.upper)
        effect = Duhem(slopes)
        output = float(effect.apply(effect.at_rest(), fading)[1][-1])
    return evolve(fitted, slopes=evolve(slopes, rest=output))


def _error(fitted: FittedSlopes) -> float:
    """Rms deviation (V) from the branches, by their counts."""
    seen = fitted.branches.seen
    off = (fitted.predicted() - fitted.branches.outputs)[seen]
    return float(np.sqrt(np.average(off**2, weights=fitted.branches.counts[seen])))


def _between(here: DuhemSlopes, there: DuhemSlopes, share: float) -> DuhemSlopes:
    rising, falling = (
        getattr(here, name) + share * (getattr(there, name) - getattr(here, name))
        for name in ("rising", "falling")
    )
    return evolve(here, rising=rising, falling=falling)


def _begin(slopes: DuhemSlopes, branches: Branches) -> tuple[float, float]:
    """State (input, w) at the branches' start."""
    u, output = branches.start
    return u, output - slopes.height(u)


def _centred(branches: Branches, cells: int) -> DuhemSlopes:
    """Operator without hysteresis: the splined curve nearest to all points."""
    seen = branches.seen
    inputs, outputs = branches.inputs[seen], branches.outputs[seen]
    lower, upper = float(branches.inputs.min()), float(branches.inputs.max())
    chord = float(np.polyfit(inputs, outputs, 1)[0])
    flat = np.full((cells + 3, cells + 3), chord)
    straight = DuhemSlopes(lower, upper, 0.0, 0.0, (-1.0, 1.0), flat[0], flat, flat)
    columns = [evolve(straight, centre=row).heights(inputs) for row in np.eye(cells + 3)]
    matrix = np.column_stack([np.ones_like(inputs), *columns])
    found = np.linalg.lstsq(matrix, outputs, rcond=None)[0]
    about = outputs - matrix @ found
    beyond = MARGIN * float(np.ptp(about))
    widths = float(about.min()) - beyond, float(about.max()) + beyond
    centre = np.maximum(found[1:], LEAST * chord)
    table = np.repeat(centre[:, np.newaxis], cells + 3, axis=1)
    curved = evolve(straight, offset=found[0], widths=widths, centre=centre)
    return evolve(curved, rising=table, falling=table)


def _solved(
    slopes: DuhemSlopes, branches: Branches, known: Array, strength: float | None
) -> FittedSlopes:
    """One step of Gauss and Newton: what the slopes are for the deviations that they leave."""
    centre, seen = slopes.centre[:, np.newaxis], branches.seen
    tables = np.stack((slopes.rising - centre, slopes.falling - centre))
    heights = slopes.heights(branches.inputs)
    begin, about = _begin(slopes, branches), branches.outputs - heights
    now, grown = np.array(begin), np.zeros(tables.size)
    path, reached = branches.inputs, known - heights
    values, jacobian = sensitivities(tables, slopes.grid, now, grown, path, reached)
    weight = np.sqrt(branches.counts[seen] / branches.counts[seen].mean())
    matrix, before = weight[:, np.newaxis] * jacobian[seen], tables + centre
    given = weight * (about - values)[seen] + matrix @ before.ravel()
    evidence = SmoothnessEvidence.of(matrix, given, before.shape)
    strength = evidence.best() if strength is None else strength
    rising, falling = evidence.solved(strength, LEAST * float(slopes.centre.mean()))
    return FittedSlopes(evolve(slopes, rising=rising, falling=falling), strength, 0.0, branches)
