"""Registration of an image of a grating: all its heights explained by one cell and one motion.

    height(line, pixel) = cell(u, v) + offset(line) + background

u and v, in cells, are the motion in the grating's own directions. Cell and motion are found in
turns: the mean over all cells at the positions known, then the positions at which that mean misses
the heights least, by Gauss-Newton. The cell's own shape needs not be known.

A height is missed by noise and by where an edge of this cell lies: the variance is that of the
height's noise plus the slope's square times that of the edges' places. Whole cells that are missed
by far more than others, damaged or under dust, count less (Student's distribution, by the EM
algorithm: K. L. Lange, R. J. A. Little and J. M. G. Taylor, J. Am. Stat. Assoc. 84, 881, 1989).
"""

from collections.abc import Sequence
from functools import cached_property

import numpy as np
from attrs import evolve, field, frozen

from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.types import Array
from afm_scan_ros.features.images.grating.equations import (
    Indices,
    Missed,
    MotionEquations,
    Smoothing,
)
from afm_scan_ros.features.images.grating.features import levelled
from afm_scan_ros.features.images.grating.motion import MotionForm, UnitCell, mean_cell
from afm_scan_ros.features.images.grating.rough_motion import (
    NORMAL,
    carried_over,
    first_motion,
    with_ripple,
)
from afm_scan_ros.features.images.scan_image import ScanImage, both_sides

JUDGING, TURNS = 20, 120
"""Turns in which damaged cells, noise and smoothness are judged, and most turns in all."""
SETTLED = 0.25
"""Change of the positions, over their standard deviation (rms), below which the turns end."""
FREEDOM = 4.0
"""Degrees of freedom of the Student distribution that the faults of whole cells have."""
FINEST = 96
"""Points of the mean cell along each side, at most."""
STEEPEST = 0.9
"""Quantile of the slope from which on a height shows where an edge lies."""
OF_CELL = 3
"""Intervals of f in each cell, as lines cross different parts of it. Those of g are one a cell."""
COLUMNS = 3
"""Turns in which the columns are moved one by one, before all coefficients are."""


@frozen(eq=False)
class Registration:
    """Motion of an image in cells of its grating: ``coefficients`` (count, 2) of u and v.

    ``covariance`` (2 count, 2 count) is that of u's, then of v's. ``shown`` (lines, 2, 2) is the
    information of each line on u and v, per cell squared. ``pitch`` (m) is the distance between
    neighbouring cells.
    """

    form: MotionForm
    coefficients: Array
    covariance: Array
    shown: Array
    pitch: float


def register(image: ScanImage, pitch: float) -> Registration:
    """Register trace and retrace of an image; ``pitch`` in m.

    Raises InputError where there is no retrace, no lattice of two directions is found, or trace and
    retrace do not meet at the turns, and ScanError where the motion does not settle.
    """
    rough, spacing = _begun(image, pitch)
    ringing = rough.by_columns()
    smooth = min(rough, ringing.without_ripple(), key=_State.mean_miss)
    state, rippling = _judged(smooth), _judged(ringing)
    rings = rippling.form.rings_as_a_mode(rippling.coefficients)
    if rings and rippling.explains_more(state):
        state = rippling
    return _settled(state, image.name).with_turns_closed().registration(spacing)


def _begun(image: ScanImage, pitch: float) -> tuple["_State", float]:
    """Return the state at a rough motion, and the distance of neighbouring cells, m."""
    recorded = both_sides(image)
    given = [levelled(each) for each in recorded]
    first, coefficients, share = first_motion(image, given, pitch)
    places = first.image(0, coefficients)
    cells_across = [np.hypot(*np.ptp(places, axis=axis).mean(axis=0)) for axis in (0, 1)]
    form = evolve(
        first,
        pixel_intervals=round(OF_CELL * cells_across[1]),
        line_intervals=round(cells_across[0]),
    )
    size = int(min(FINEST, 2 * round(image.pixels / cells_across[1])))
    coefficients = carried_over(first, coefficients, form)
    even = [np.ones_like(each) for each in given]
    for each in even:
        each[0 if image.upward else -1] = 0.0
    return _State(form, coefficients, recorded, given, even, even, size), share * pitch


def _judged(state: "_State") -> "_State":
    """Return the state after the turns in which cells, noise and smoothness are judged."""
    for _ in range(JUDGING):
        state = state.turned(judging=True)
    return state


def _settled(state: "_State", name: str) -> "_State":
    """Return the state after the turns have settled; raises ScanError where they do not."""
    for _ in range(JUDGING, TURNS):
        state = state.turned(judging=False)
        if state.change < SETTLED:
            return state
    raise ScanError(
        f"{name}: the cells of the grating do not fit one mean cell: the positions still"
        f" change by {state.change:.2g} times their uncertainty: give an image with less noise"
    )


@frozen(eq=False)
class _State:
    """A turn: the motion, the heights without background, and the weights of the cells.

    ``recorded`` are the heights of the image, ``heights`` the same without background. Heights
    count by their ``weights``, and not at all where ``steady`` is zero: in the line scanned first,
    which begins at rest. ``size`` is that of the mean cell, ``change`` the rms by which the last
    turn moved the positions, over their standard deviation.
    """

    form: MotionForm
    coefficients: Array
    recorded: Sequence[Array]
    heights: Sequence[Array]
    weights: Sequence[Array]
    steady: Sequence[Array]
    size: int
    noise: float = 0.0
    edges: float = 0.0
    smoothing: Smoothing = field(factory=Smoothing)
    change: float = np.inf

    @cached_property
    def cell(self) -> UnitCell:
        """The mean over all cells."""
        return mean_cell(self.form, self.coefficients, self.heights, self.weights, self.size)

    def by_columns(self) -> "_State":
        """Return the state whose columns have moved to where they fit best, with a ripple."""
        state = self
        for _ in range(COLUMNS):
            form, moved = with_ripple(state.form, state.coefficients, self.heights, state.cell)
            state = evolve(state, form=form, coefficients=moved)
        return state

    def without_ripple(self) -> "_State":
        """Return the state without its ripple."""
        form = evolve(self.form, ripple=None)
        kept = [self.coefficients[self.form.smooth_part(direction)] for direction in range(2)]
        moved = np.vstack([*kept, self.coefficients[2 * self.form.fast :]])
        return evolve(self, form=form, coefficients=moved)

    def mean_miss(self) -> float:
        """Mean magnitude by which the mean cell misses the heights."""
        return float(np.mean([np.abs(self.missed(d).residual) for d in range(len(self.heights))]))

    def explains_more(self, plainer: "_State") -> bool:
        """Whether more numbers explain more than they cost, by Schwarz's criterion.

        The variances of noise and edges say what each explains, whatever damaged cells miss.
        Heights that share the faults of their cell count less.
        """
        excess = MotionEquations.of(self.form, self.all_missed, self.weights).excess
        heights = sum(each.size for each in self.heights) / excess
        gain = (plainer.log_variance - self.log_variance) / excess
        return bool(gain > 2 * (self.form.count - plainer.form.count) * np.log(heights))

    @property
    def all_missed(self) -> list[Missed]:
        """What each direction misses, weighed by the variances of noise and edges."""
        return [self.missed(d).scaled(self.noise, self.edges) for d in range(len(self.heights))]

    @property
    def log_variance(self) -> float:
        """Sum of the logarithms of the variances of all heights."""
        return -float(sum(np.sum(np.log(each.weight)) for each in self.all_missed))

    def missed(self, direction: int) -> Missed:
        """Compare the heights of a direction with the mean cell."""
        where = self.form.image(direction, self.coefficients)
        u, v = where[..., 0], where[..., 1]
        residual = self.heights[direction] - self.cell.height(u, v)
        return Missed(u, v, residual, *self.cell.slopes(u, v), np.ones_like(u))

    def turned(self, *, judging: bool) -> "_State":
        """Return the next turn, with the weights of this one unless it is ``judging``."""
        missed = [self.missed(direction) for direction in range(len(self.heights))]
        noise, edges = _spread(missed) if judging else (self.noise, self.edges)
        missed = [each.scaled(noise, edges) for each in missed]
        likely = _cell_weights(missed, self.steady, self.cell) if judging else self.weights
        weights = [known * each for known, each in zip(self.steady, likely, strict=True)]
        equations = MotionEquations.of(self.form, missed, weights)
        step, smoothing = equations.step(self.coefficients, self.smoothing)
        heights = [
            recorded - _background(recorded - level + each.residual, each, w * each.weight)
            for recorded, level, each, w in zip(
                self.recorded, self.heights, missed, weights, strict=True
            )
        ]
        return evolve(
            self,
            coefficients=self.coefficients + step,
            heights=heights,
            weights=weights,
            noise=noise,
            edges=edges,
            smoothing=smoothing if judging else self.smoothing,
            change=self._change(step, equations),
        )

    def _change(self, step: Array, equations: MotionEquations) -> float:
        """Rms of a change (count, 2) of the coefficients, over the positions' deviation.

        A shift of all positions is no change: cell and motion may shift together.
        """
        moved = np.concatenate([self.form.coarse(d) @ step for d in range(len(self.heights))])
        moved -= moved.mean(axis=0)
        known = equations.covariance(self.smoothing.precision(self.form))
        deviation = np.concatenate(
            [self.form.variances(d, known) for d in range(len(self.heights))]
        )
        return float(np.sqrt(np.mean(moved**2) / np.mean(deviation)))

    def with_turns_closed(self) -> "_State":
        """Return the state whose retrace is shifted by whole cells to meet the trace at the turns.

        A shift by whole cells changes no height. Raises InputError where the two turns need
        different shifts.
        """
        gaps = self.form.turns() @ self.coefficients
        whole = np.rint(gaps)
        if np.any(whole[0] != whole[1]):
            raise InputError(
                "which cell of the trace is which of the retrace is not clear, as they are"
                f" {np.abs(gaps).max():.2g} cells apart at a turn: give an image of a smaller range"
            )
        shifted = self.form.with_retrace_shifted(self.coefficients, whole[0])
        return evolve(self, coefficients=shifted)

    def registration(self, pitch: float) -> Registration:
        """Return what was found."""
        missed = self.all_missed
        whole = MotionEquations.of(self.form, missed, self.weights)
        prior = self.smoothing.precision(self.form)
        pairs = zip(missed, self.weights, strict=True)
        return Registration(
            self.form,
            self.coefficients,
            whole.uncertainty(prior, missed, self.weights, _numbers(missed, self.cell)),
            np.sum([each.information(likely) for each, likely in pairs], axis=0),
            pitch,
        )


def _spread(missed: Sequence[Missed]) -> tuple[float, float]:
    """Standard deviations of the heights' noise, and of the edges' places in cells.

    The flatter half of the heights shows the noise, the steepest tenth the edges.
    """
    squares = np.concatenate([each.residual.ravel() ** 2 for each in missed])
    steep = np.concatenate([each.steepness.ravel() for each in missed])
    flat, sharp = steep <= np.median(steep), steep >= np.quantile(steep, STEEPEST)
    noise = NORMAL**2 * np.median(squares[flat])
    beyond = NORMAL**2 * np.median(squares[sharp]) - noise
    return float(np.sqrt(noise)), float(np.sqrt(max(beyond, noise) / np.median(steep[sharp])))


def _cell_weights(missed: Sequence[Missed], steady: Sequence[Array], cell: UnitCell) -> list[Array]:
    """Weights of all heights, by how far their whole cell is missed; trace and retrace apart.

    Heights that are not ``steady`` do not count.
    """
    result: list[Array] = []
    for each, counts, numbers in zip(missed, steady, _numbers(missed, cell), strict=True):
        index = np.unique(numbers, return_inverse=True)[1].ravel()
        count = np.bincount(index, counts.ravel())
        total = np.bincount(index, (counts * each.weight * each.residual**2).ravel())
        square = total[count > 0.0] / count[count > 0.0]
        likely = np.ones(len(count))
        likely[count > 0.0] = (FREEDOM + 1.0) / (FREEDOM + square / np.median(square))
        result.append(likely[index].reshape(each.u.shape))
    return result


def _numbers(missed: Sequence[Missed], cell: UnitCell) -> list[Indices]:
    """Number of the cell at each pixel, the same in trace and retrace: (lines, pixels) each."""
    places = np.stack([np.stack([each.u, each.v], axis=-1) for each in missed]) - cell.border
    whole = np.floor(places).astype(np.int64)
    whole -= whole.min(axis=(0, 1, 2))
    return list(whole[..., 0] * (whole[..., 1].max() + 1) + whole[..., 1])


def _background(residual: Array, where: Missed, weight: Array) -> Array:
    """Parabola that fits a residual (lines, pixels) of each line, against the place along it.

    A tilted sample adds its tilt times the place. That is no parabola of the pixel where the
    scanner is not linear.
    """
    ends = np.array([np.mean(each[:, -1] - each[:, 0]) for each in (where.u, where.v)])
    place = (where.u * ends[0] + where.v * ends[1]) * 2.0 / (ends @ ends)
    place -= place.mean(axis=1, keepdims=True)
    terms = np.stack([np.ones_like(place), place, place**2])
    gram = np.einsum("lp,ilp,jlp->lij", weight, terms, terms)
    gram += 1e-9 * np.trace(gram, axis1=1, axis2=2)[:, np.newaxis, np.newaxis] * np.eye(3) + 1e-300
    moment = np.einsum("lp,ilp->li", weight * residual, terms)
    factors = np.linalg.solve(gram, moment[..., np.newaxis])[..., 0]
    return np.asarray(np.einsum("li,ilp->lp", factors, terms))
