"""How well a model predicts a motion, by its error on its records."""

import numpy as np
from attrs import evolve

from afm_scan_ros.core.diagnosis.discrepancy import detection_limit
from afm_scan_ros.core.effects.scale import resonance_of
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.extension import unknown_beyond
from afm_scan_ros.core.model import ScannerModel
from afm_scan_ros.core.types import Array, Trace


def standard_deviation(model: ScannerModel, drive: Trace, moved: Trace) -> Trace:
    """Standard deviation (m) of a motion predicted for a drive (V), without the sensor's noise.

    It is the rms error of the whole motion, and more where the drive leaves the identified range.
    Raises InputError where an axis states no error.
    """
    found = {
        name: _of_axis(model, name, getattr(drive, name), getattr(moved, name), drive.sample_period)
        for name in model.axes
    }
    still = np.zeros_like(moved.x)
    return evolve(moved, x=found.get("x", still), y=found.get("y", still))


def _of_axis(
    model: ScannerModel, name: str, drive: Array, moved: Array, sample_period: float
) -> Array:
    axis = model.axis(name)
    if not axis.model_discrepancies:
        raise InputError(
            f"the model of axis {name} states no error, so none of a prediction: identify it anew,"
            " with a validation record"
        )
    resonance = resonance_of(axis.vibration, sample_period)
    limit = detection_limit(axis.model_discrepancies, moved, sample_period, resonance)
    known = np.sqrt(np.sum(np.maximum(limit.rms**2 - limit.noise**2, 0.0)))
    return np.asarray(np.hypot(known, unknown_beyond(axis, drive)))
