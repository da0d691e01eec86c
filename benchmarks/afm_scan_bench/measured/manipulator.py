"""What is foretold of a micromanipulator that others recorded, and what our inverse would leave."""

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
    "prediction_um": ("foretold", ".3f"),
    "drive_mv": ("drive, mV", ".1f"),
    "tracking_um": ("tracking", ".3f"),
    "ours_um": ("ours", ".3f"),
}
"""Rms errors: of the displacement foretold; of the drive that our inverse asks for the measured
displacement; of the measured displacement against the desired; of what ours would have left."""


def measure() -> Table:
    """Judge our model and its inverse on each segment that has not taught, mean removed."""
    study = Study()
    title = (
        "Piezo micromanipulator, data © 2019 Yan Naing Aye (MIT): what did not teach,\n"
        f"µm rms, each mean removed (what taught is fitted to {study.fit.fitted / MICRO:.3f})"
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
        "ours_um": _rms(_off(study.foretold, study.desired, segment)) / MICRO,
    }


def _off(signal: Array, reference: Array, segment: Segment) -> Array:
    """Difference over a segment, its mean removed."""
    difference = (signal - reference)[segment.samples]
    return np.asarray(difference - difference.mean())


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))
