"""Rough motions of an image, from which a fit of all heights begins.

The first goes through the cells of the grating, found one by one. A scanner that rings moves to and
fro by much of a cell, which turns of Gauss-Newton do not reach from a smooth motion. All lines show
the same column, so its shift is sought by trial.
"""

from collections.abc import Sequence

import numpy as np

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.imaging.grating.features import (
    Cells,
    Lattice,
    cells_of,
    lattice_of,
)
from afm_scan_ros.core.imaging.grating.motion import MotionForm, middles
from afm_scan_ros.core.imaging.grating.unit_cell import UnitCell
from afm_scan_ros.core.imaging.scan_image import ScanImage
from afm_scan_ros.core.types import Array

ROUGH = 2
"""Intervals of the splines through single cells."""
NEAREST = 2.0**-0.25
"""Least period of an image over the pitch stated: halfway to that of a cell's diagonal."""
MICRO = 1e6
WEAK = 1e-6
"""Share of a penalty on roughness, which decides only where no cell does."""
REACH, TRIALS = 0.35, 29
"""Greatest shift in cells, so that no neighbouring edge is nearer, and shifts tried."""
LINES = 64
"""Lines that are looked at, evenly spaced: enough to tell a column's place."""
SMOOTH = 1e-3
"""Share of a penalty on roughness of the shifts."""


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
    form = MotionForm(image.lines, image.pixels, ROUGH, ROUGH)
    cells = cells_of(heights, lattice.vectors)
    _refuse_shorter(image, lattice, pitch)
    coefficients = _through(form, cells)
    if len(cells) == 2:  # noqa: PLR2004 - trace and retrace
        apart = form.gaps_at_turns(coefficients, image.overscan).mean(axis=0)
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
    """Coefficients (count, 2) that give the cells of one direction or both their numbers."""
    basis = np.vstack([form.rows(d, *_relative(form, c.places)) for d, c in enumerate(cells)])
    known = np.vstack([each.numbers for each in cells]).astype(float)
    return _solved(form, basis, known)


def _solved(form: MotionForm, basis: Array, known: Array) -> Array:
    """Least squares of numbers (n, 2) by factors (n, count), the smoothest where many serve."""
    rough = np.sqrt(WEAK * len(basis)) * np.vstack([*form.roughness(), WEAK * np.eye(form.count)])
    padded = np.vstack([known, np.zeros((len(rough), 2))])
    return np.asarray(np.linalg.lstsq(np.vstack([basis, rough]), padded, rcond=None)[0])


def _relative(form: MotionForm, places: Array) -> tuple[Array, Array]:
    """Lines and pixels of places (n, 2), from -1 to 1."""
    return (
        (2.0 * places[:, 0] + 1.0) / form.lines - 1.0,
        (2.0 * places[:, 1] + 1.0) / form.pixels - 1.0,
    )


def carried_over(
    rough: MotionForm, coefficients: Array, form: MotionForm, directions: int
) -> Array:
    """Coefficients of a motion in another form."""
    grid = np.meshgrid(middles(33), middles(33), indexing="ij")
    line, pixel = (each.ravel() for each in grid)
    basis = np.vstack([form.rows(d, line, pixel) for d in range(directions)])
    known = np.vstack([rough.rows(d, line, pixel) @ coefficients for d in range(directions)])
    return _solved(form, basis, known)


def columns_moved(
    form: MotionForm, coefficients: Array, heights: Sequence[Array], cell: UnitCell
) -> Array:
    """Coefficients (count, 2) after each column has moved along the line to where it fits best.

    ``heights`` (lines, pixels) are those of each direction.
    """
    moved = coefficients.copy()
    basis = form.along(middles(form.pixels))
    rough = np.sqrt(SMOOTH * form.pixels) * np.diff(np.eye(form.fast), 3, axis=0)
    for direction, seen in enumerate(heights):
        where = form.image(direction, coefficients)
        along = (where[:, -1] - where[:, 0]).mean(axis=0)
        along /= np.hypot(*along)
        every = max(1, form.lines // LINES)
        shifts = _best_shifts(where[::every], along, seen[::every], cell)
        known = np.vstack([np.outer(shifts, along), np.zeros((len(rough), 2))])
        first = direction * form.fast
        change = np.linalg.lstsq(np.vstack([basis, rough]), known, rcond=None)[0]
        moved[first : first + form.fast] += change
    return moved


def _best_shifts(where: Array, along: Array, seen: Array, cell: UnitCell) -> Array:
    """Shift of each column, in cells, at which the mean cell misses its heights least: (pixels,).

    Misses count by their size and not by their square, as damaged cells are far off.
    """
    shifts = np.linspace(-REACH, REACH, TRIALS)
    misses = np.array([_misses(where + shift * along, seen, cell) for shift in shifts])
    best = np.clip(misses.argmin(axis=0), 1, TRIALS - 2)
    before, at, after = (misses[best + step, np.arange(len(best))] for step in (-1, 0, 1))
    bend = before - 2.0 * at + after
    fine = np.where(bend > 0.0, 0.5 * (before - after) / np.where(bend > 0.0, bend, 1.0), 0.0)
    return np.asarray(shifts[best] + np.clip(fine, -1.0, 1.0) * (shifts[1] - shifts[0]))


def _misses(where: Array, seen: Array, cell: UnitCell) -> Array:
    missed = seen - cell.height(where[..., 0], where[..., 1])
    return np.asarray(np.abs(missed - np.median(missed, axis=1)[:, np.newaxis]).mean(axis=0))
