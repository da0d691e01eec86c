"""Columns of an image one by one: how far each lies from a smooth motion.

A scanner that rings moves to and fro by much of a cell, which turns of Gauss-Newton do not reach
from a smooth motion. All lines show the same column, so its shift is sought by trial.
"""

from collections.abc import Sequence

import numpy as np

from afm_scan_ros.core.imaging.grating.motion import MotionForm, middles
from afm_scan_ros.core.imaging.grating.unit_cell import UnitCell
from afm_scan_ros.core.types import Array

REACH, TRIALS = 0.35, 29
"""Greatest shift in cells, so that no neighbouring edge is nearer, and shifts tried."""
LINES = 64
"""Lines that are looked at, evenly spaced: enough to tell a column's place."""
SMOOTH = 1e-3
"""Share of a penalty on roughness of the shifts."""


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
