"""Rough motions of an image, from which a fit of all heights begins.

The first goes through the cells of the grating, found one by one. A scanner that rings moves to and
fro by much of a cell, which turns of Gauss-Newton do not reach from a smooth motion. All lines show
the same column, so its shift is sought by trial, and the ripple in these shifts. Its amplitude and
phase are those of a mode behind a triangle, up to the share that hysteresis leaves.
"""

from collections.abc import Iterator, Sequence

import numpy as np
from attrs import evolve, frozen
from scipy.linalg import block_diag
from scipy.optimize import least_squares

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import Array
from afm_scan_ros.features.images.grating.features import (
    Cells,
    Lattice,
    cells_of,
    lattice_of,
)
from afm_scan_ros.features.images.grating.motion import (
    MotionForm,
    Ripple,
    UnitCell,
    middles,
    since_turn,
    spline_basis,
)
from afm_scan_ros.features.images.scan_image import ScanImage

ROUGH = 2
"""Intervals of the splines through single cells."""
NEAREST = 2.0**-0.25
"""Least period of an image over the pitch stated: halfway to that of a cell's diagonal."""
MICRO = 1e6
SMOOTH, WEAK = 0.1, 1e-9
"""Standard deviation of a cell's place, over those of third differences and of coefficients."""
REACH, TRIALS = 0.35, 29
"""Greatest shift in cells, so that no neighbouring edge is nearer, and shifts tried."""
BESIDE = (-2, 2)
"""Trials from the best shift at which more is missed if an edge is there."""
LINES = 64
"""Lines that are looked at, evenly spaced: enough to tell a column's place."""
NORMAL = 1.4826
"""Standard deviation of a normal distribution over its median absolute deviation."""
SLOWEST, OF_PERIOD, FINEST = 3.0, 4, 4
"""Fewest periods of a ripple in a line, trials for each, and fewest pixels of a period."""
DAMPINGS, HEAVIEST = (0.003, 0.01, 0.03, 0.1), 0.5
"""Damping ratios tried, and the greatest one."""
SHARES = (0.5, 1.2)
"""Least and greatest speed after a turn over the mean one: hysteresis slows it down."""
SMOOTHEST = 1
"""Intervals of the smooth motion beside which a ripple is sought."""


def first_motion(
    image: ScanImage, heights: Sequence[Array], pitch: float
) -> tuple[MotionForm, Array, float]:
    """Return a rough motion of an image by its cells, found one by one: (count, 2).

    The retrace is shifted by whole cells to meet the trace at the turns. The third value is the
    distance of neighbouring cells over ``pitch``. Raises InputError where the grating has a shorter
    period than that pitch.
    """
    nominal = (pitch / image.range_y * image.lines, pitch / image.range_x * image.pixels)
    lattice = lattice_of(heights[0], nominal)
    form = MotionForm(image.lines, image.pixels, ROUGH, ROUGH, image.overscan)
    cells = cells_of(heights, lattice.vectors)
    _refuse_shorter(image, lattice, pitch)
    coefficients = _through(form, cells)
    apart = (form.turns() @ coefficients).mean(axis=0)
    coefficients = form.with_retrace_shifted(coefficients, np.rint(apart))
    return form, coefficients, lattice.share


def _refuse_shorter(image: ScanImage, lattice: Lattice, pitch: float) -> None:
    """Refuse a pitch that is a multiple of the grating's own, or the diagonal of its cell."""
    period = lattice.period / lattice.share
    if period < NEAREST:
        raise InputError(
            f"the grating repeats every {MICRO * period * pitch:.3g} µm of a scan of"
            f" {MICRO * image.range_x:.4g} by {MICRO * image.range_y:.4g} µm, and not every"
            f" {MICRO * pitch:.4g} µm: give the distance of neighbouring cells as the pitch, or"
            " mend the scan size in the file if that is wrong"
        )


def _through(form: MotionForm, cells: Sequence[Cells]) -> Array:
    """Coefficients (count, 2) that give the cells of both directions their numbers."""
    basis = np.vstack([form.rows(d, *_relative(form, c.places)) for d, c in enumerate(cells)])
    known = np.vstack([each.numbers for each in cells]).astype(float)
    return _solved(form, basis, known)


def _solved(form: MotionForm, basis: Array, known: Array) -> Array:
    """Least squares of numbers (n, 2) by factors (n, count), the smoothest where many serve."""
    rough = np.vstack([SMOOTH * each for each in form.roughness()] + [WEAK * np.eye(form.count)])
    padded = np.vstack([known, np.zeros((len(rough), 2))])
    return np.asarray(np.linalg.lstsq(np.vstack([basis, rough]), padded, rcond=None)[0])


def _relative(form: MotionForm, places: Array) -> tuple[Array, Array]:
    """Lines and pixels of places (n, 2), from -1 to 1."""
    return (
        (2.0 * places[:, 0] + 1.0) / form.lines - 1.0,
        (2.0 * places[:, 1] + 1.0) / form.pixels - 1.0,
    )


def carried_over(rough: MotionForm, coefficients: Array, form: MotionForm) -> Array:
    """Coefficients of a motion in another form."""
    known = np.vstack([rough.coarse(d) @ coefficients for d in range(2)])
    return _solved(form, np.vstack([form.coarse(d) for d in range(2)]), known)


def _best_shifts(where: Array, along: Array, seen: Array, cell: UnitCell) -> tuple[Array, Array]:
    """Shift of each column, in cells, at which the mean cell misses its heights least: (pixels,).

    Misses count by their size and not by their square, as damaged cells are far off. The second
    value is how much more is missed on either side, at least: nothing where no edge is near.
    """
    shifts = np.linspace(-REACH, REACH, TRIALS)
    misses = np.array([_misses(where + shift * along, seen, cell) for shift in shifts])
    best = np.clip(misses.argmin(axis=0), 1, TRIALS - 2)
    before, at, after = (misses[best + step, np.arange(len(best))] for step in (-1, 0, 1))
    bend = before - 2.0 * at + after
    fine = np.where(bend > 0.0, 0.5 * (before - after) / np.where(bend > 0.0, bend, 1.0), 0.0)
    found = shifts[best] + np.clip(fine, -1.0, 1.0) * (shifts[1] - shifts[0])
    beside = [misses[np.clip(best + step, 0, TRIALS - 1), np.arange(len(best))] for step in BESIDE]
    return found, np.maximum(np.minimum(*beside) - at, 0.0)


def _misses(where: Array, seen: Array, cell: UnitCell) -> Array:
    missed = seen - cell.height(where[..., 0], where[..., 1])
    return np.asarray(np.abs(missed - np.median(missed, axis=1)[:, np.newaxis]).mean(axis=0))


def with_ripple(
    form: MotionForm, coefficients: Array, heights: Sequence[Array], cell: UnitCell
) -> tuple[MotionForm, Array]:
    """Form with the ripple that shows once each column moves along the line to where it fits.

    ``heights`` (lines, pixels) are those of each direction. The motion in the new form, (count, 2),
    is the second value.
    """
    columns = [
        _Columns.of(form, direction, coefficients, seen, cell)
        for direction, seen in enumerate(heights)
    ]
    found, amplitude, smooth = _RippleFit.through(columns, form.overscan).fitted()
    ringing = evolve(form, ripple=found)
    result = np.zeros((ringing.count, 2))
    result[2 * ringing.fast :] = coefficients[2 * form.fast :]
    basis = spline_basis(middles(form.pixels), form.pixel_intervals)
    for direction, (each, along) in enumerate(zip(columns, smooth, strict=True)):
        splines = ringing.smooth_part(direction)
        places = np.outer(along, each.way) + each.across
        result[splines] = np.linalg.lstsq(basis, places, rcond=None)[0]
        result[splines.stop : splines.stop + 2] = each.sign * np.outer(amplitude, each.way)
    return ringing, result


@frozen(eq=False)
class _Columns:
    """Columns of a direction that each moved along the line to where they fit best.

    ``along`` (pixels,) are their places along the ``way`` (2,) of the line, ``across`` (pixels, 2)
    what is at a right angle to it, ``root`` (pixels,) the roots of weights. ``passed`` (pixels,) is
    the time since the turn over that of a line one way. The drive of the retrace is that of the
    trace turned round, so its ripple has the other ``sign``.
    """

    along: Array
    way: Array
    across: Array
    root: Array
    passed: Array
    sign: float

    @classmethod
    def of(
        cls, form: MotionForm, direction: int, coefficients: Array, seen: Array, cell: UnitCell
    ) -> "_Columns":
        where = form.image(direction, coefficients)
        way = (where[:, -1] - where[:, 0]).mean(axis=0)
        way /= np.hypot(*way)
        every = max(1, form.lines // LINES)
        shifts, weight = _best_shifts(where[::every], way, seen[::every], cell)
        places = middles(form.pixels)
        before = form.along(direction, places) @ coefficients[form.part(direction)]
        along = before @ way
        passed = since_turn(direction, places)
        across, root = before - np.outer(along, way), np.sqrt(weight / weight.mean())
        return cls(along + shifts, way, across, root, passed, -1.0 if direction else 1.0)

    def ripple(self, found: Ripple, amplitude: Array) -> Array:
        """Ripple (pixels,) of an amplitude (2,) in the trace."""
        return np.asarray(self.sign * found.columns(self.passed)[:, :2] @ amplitude)


@frozen(eq=False)
class _RippleFit:
    """A smooth motion and a ripple through ``columns``, both directions at once.

    Values are ln periods, ln damping, the ripple's share of that of a line without hysteresis, and
    the coefficients of each direction's splines, whose values are ``basis`` (pixels, count).
    ``distance`` is that of a line, in cells.
    """

    columns: Sequence[_Columns]
    overscan: float
    basis: Array
    distance: float

    @classmethod
    def through(cls, columns: Sequence[_Columns], overscan: float) -> "_RippleFit":
        basis = spline_basis(middles(len(columns[0].root)), SMOOTHEST)
        distance = float(np.mean([np.ptp(each.along) for each in columns]))
        return cls(columns, overscan, basis, distance)

    def fitted(self) -> tuple[Ripple, Array, Sequence[Array]]:
        """Ripple, its amplitude (2,) in the trace, and the smooth motion (pixels,) of each side.

        Columns that are far off count less.
        """
        begin = self._begin()
        spread = NORMAL * float(np.median(np.abs(self._missed(begin))))
        most = np.full(len(begin), np.inf)
        most[1] = np.log(HEAVIEST)
        found = least_squares(
            self._missed,
            begin,
            bounds=(-np.inf, most),
            x_scale="jac",
            loss="soft_l1",
            f_scale=spread,
        ).x
        ripple = _ripple(found)
        smooth = [self.basis @ each for each in self._splines(found)]
        return ripple, found[2] * self._amplitude(ripple), smooth

    def _splines(self, values: Array) -> Array:
        return np.asarray(values[3:].reshape(len(self.columns), -1))

    def _amplitude(self, ripple: Ripple) -> Array:
        """Amplitude (2,) of a ripple in the trace, without hysteresis."""
        rings = self.distance * ripple.behind_a_triangle(self.overscan)
        return np.array([rings.real, -rings.imag])

    def _missed(self, values: Array) -> Array:
        ripple = _ripple(values)
        amplitude = values[2] * self._amplitude(ripple)
        pairs = zip(self.columns, self._splines(values), strict=True)
        return np.concatenate(
            [
                each.root * (each.ripple(ripple, amplitude) + self.basis @ own - each.along)
                for each, own in pairs
            ]
        )

    def _begin(self) -> Array:
        """Values of the ripple that explains most of those tried."""
        roots = np.concatenate([each.root for each in self.columns])
        smooth = roots[:, np.newaxis] * block_diag(*(self.basis for _ in self.columns))
        space = np.linalg.qr(smooth)[0]
        moved = roots * np.concatenate([each.along for each in self.columns])
        most, best, share, taken = -np.inf, np.zeros(2), 0.0, moved
        for values in _tried(len(self.basis)):
            ripple = _ripple(values)
            amplitude = self._amplitude(ripple)
            rings = roots * np.concatenate([e.ripple(ripple, amplitude) for e in self.columns])
            beside = rings - space @ (space.T @ rings)
            likely = float(np.clip(beside @ moved / (beside @ beside), *SHARES))
            explained = likely * float(2.0 * beside @ moved - likely * beside @ beside)
            if explained > most:
                most, best, share, taken = explained, values, likely, moved - likely * rings
        splines = np.linalg.lstsq(smooth, taken, rcond=None)[0]
        return np.concatenate([best, [share], splines])


def _tried(pixels: int) -> Iterator[Array]:
    """Yield ln periods and ln damping of ripples tried for a line of so many pixels."""
    for periods in np.arange(SLOWEST, pixels / FINEST, 1.0 / OF_PERIOD):
        for damping in DAMPINGS:
            yield np.log([periods, damping])


def _ripple(values: Array) -> Ripple:
    periods, damping = np.exp(values[:2])
    return Ripple(float(periods), float(damping))
