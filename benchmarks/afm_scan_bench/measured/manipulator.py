"""Held-out prediction errors of a measured micromanipulator, and errors with our inverse."""

from functools import partial

import numpy as np

from afm_scan_bench.measured.micromanipulator.figure import manipulator_figure
from afm_scan_bench.measured.micromanipulator.study import (
    JUDGED,
    MICRO,
    WITH_INVERSE,
    Segment,
    Study,
)
from afm_scan_ros.core.types import Array
from afm_scan_ros.report.table import Row, Table

COLUMNS = {
    "segment": ("inverse, path", ""),
    "from_s": ("from, s", ".2f"),
    "to_s": ("to, s", ".2f"),
    "prediction_um": ("prediction", ".3f"),
    "drive_mv": ("drive of our inverse, mV", ".1f"),
    "tracking_um": ("tracking, measured", ".3f"),
    "ours_um": ("tracking with our inverse, predicted", ".3f"),
}
"""Rms errors of: the predicted displacement; the drive that our inverse gives for the measured
displacement; the measured tracking; the predicted tracking with our inverse."""


def measure() -> Table:
    """State the errors of our model and its inverse on each held-out segment."""
    study = Study()
    title = (
        "Piezo micromanipulator, data © 2019 Yan Naing Aye (MIT): held-out errors,\n"
        f"µm rms, each mean removed (error of the fit: {study.fitted / MICRO:.3f})"
    )
    rows = [_row(study, segment) for segment in (*JUDGED, WITH_INVERSE)]
    return Table("manipulator", title, COLUMNS, rows, picture=partial(manipulator_figure, study))


def _row(study: Study, segment: Segment) -> Row:
    predicted = _off(study.predicted, study.measured, segment)
    return {
        "segment": segment.name,
        "from_s": segment.start,
        "to_s": segment.end,
        "prediction_um": _rms(predicted) / MICRO,
        "prediction_max_um": float(np.abs(predicted).max()) / MICRO,
        "drive_mv": 1e3 * _rms(_off(study.inverted, study.drive, segment)),
        "tracking_um": _rms(_off(study.measured, study.desired, segment)) / MICRO,
        "expected_um": _rms(_off(study.predicted, study.desired, segment)) / MICRO,
        "ours_um": _rms(_off(study.predicted_with_ours, study.desired, segment)) / MICRO,
    }


def _off(signal: Array, reference: Array, segment: Segment) -> Array:
    """Difference over a segment, its mean removed."""
    difference = (signal - reference)[segment.samples]
    return np.asarray(difference - difference.mean())


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))
