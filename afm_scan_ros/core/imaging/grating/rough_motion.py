"""The rough motion of an image, through the cells of the grating that are found one by one."""

from collections.abc import Sequence
from typing import TypeAlias

import numpy as np
from attrs import evolve
from numpy.typing import NDArray

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.imaging.grating.features import (
    Cells,
    Lattice,
    cells_of,
    lattice_of,
)
from afm_scan_ros.core.imaging.grating.motion import MotionForm, middles
from afm_scan_ros.core.imaging.scan_image import ScanImage
from afm_scan_ros.core.types import Array

Indices: TypeAlias = NDArray[np.int64]
ROUGH = 2
"""Intervals of the splines through single cells."""
NEAREST = 2.0**-0.25
"""Least period of an image over the pitch stated: halfway to that of a cell's diagonal."""
MICRO = 1e6
WEAK = 1e-6
"""Share of a penalty on roughness, which decides only where no cell does."""


def first_motion(
    image: ScanImage, heights: Sequence[Array], pitch: float
) -> tuple[MotionForm, Array, float]:
    """Return a rough motion of an image by its cells, found one by one: (count, 2).

    The third value is the distance of neighbouring cells over ``pitch``. Raises InputError where
    the grating has a shorter period than that pitch.
    """
    nominal = (pitch / image.range_y * image.lines, pitch / image.range_x * image.pixels)
    lattice = lattice_of(heights[0], nominal)
    form = MotionForm(image.lines, image.pixels, ROUGH, ROUGH)
    cells = cells_of(heights, lattice.vectors)
    _refuse_shorter(image, lattice, pitch)
    if len(cells) == 2:  # noqa: PLR2004 - trace and retrace
        apart = _whole_cells_apart(form, cells, image.overscan)
        cells[1] = evolve(cells[1], numbers=cells[1].numbers + apart)
    return form, _through(form, cells), lattice.share


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


def _through(form: MotionForm, cells: Sequence[Cells], first: int = 0) -> Array:
    """Coefficients (count, 2) that give the cells of one direction or both their numbers."""
    pairs = list(enumerate(cells, start=first))
    basis = np.vstack([form.rows(d, *_relative(form, each.places)) for d, each in pairs])
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


def _whole_cells_apart(form: MotionForm, cells: Sequence[Cells], overscan: float) -> Indices:
    """Whole cells to add to the retrace's numbers, so that it meets the trace at the turns.

    What lies between trace and retrace is a parabola, nearly zero at either turn.
    """
    pixels = np.linspace(-1.0, 1.0, 9)
    middle = np.zeros_like(pixels)
    trace, retrace = (
        form.rows(d, middle, pixels) @ _through(form, [each], d) for d, each in enumerate(cells)
    )
    turns = np.array([-1.0, 1.0]) * (1.0 + 2.0 * overscan)
    parabola = np.polynomial.polynomial.polyfit(pixels, trace - retrace, 2)
    gaps = np.polynomial.polynomial.polyval(turns, parabola)
    whole: Indices = np.rint(gaps.mean(axis=-1)).astype(np.int64)
    return whole


def carried_over(
    rough: MotionForm, coefficients: Array, form: MotionForm, directions: int
) -> Array:
    """Coefficients of a motion in another form."""
    grid = np.meshgrid(middles(33), middles(33), indexing="ij")
    line, pixel = (each.ravel() for each in grid)
    basis = np.vstack([form.rows(d, line, pixel) for d in range(directions)])
    known = np.vstack([rough.rows(d, line, pixel) @ coefficients for d in range(directions)])
    return _solved(form, basis, known)
