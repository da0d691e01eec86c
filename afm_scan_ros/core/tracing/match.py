"""Whether a record is of the scanner that a model was identified on."""

import numpy as np

from afm_scan_ros.core.effects.hysteresis.everett import BeyondRangeError
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.model import ScannerModel
from afm_scan_ros.core.prediction import predict
from afm_scan_ros.core.tracing.observation import Observation
from afm_scan_ros.core.types import AXES, Array

VISIBLE = 1e-7
"""m rms of predicted motion, below which a record cannot contradict a model so grossly."""
LIKE_GAINS = (0.5, 2.0)
ALIKE = 0.7
"""Correlation of predicted and measured motion, below which they are not of one axis."""


def refuse_foreign(model: ScannerModel, observed: Observation) -> None:
    """Refuse a record that no fault of this scanner explains: another one's, or in other units.

    Raises InputError, which names the record, the axis and the mend; also where the drive leaves
    the range that the model was identified in.
    """
    try:
        predicted = predict(model, observed.drive)
    except BeyondRangeError as error:
        raise InputError(
            f"{observed.name}: the drive is {error.value:.4g} V at sample {error.sample}, and the"
            f" model was identified to {error.limit:.4g} V: give a record of a smaller drive, or"
            " identify the model to a larger one"
        ) from error
    for axis in AXES:
        _refuse_unlike(
            f"{observed.name}: axis {axis}", predicted.axis(axis), observed.displacement.axis(axis)
        )


def _refuse_unlike(where: str, predicted: Array, measured: Array) -> None:
    expected, seen = predicted - predicted.mean(), measured - measured.mean()
    strength = float(expected @ expected)
    if strength < VISIBLE**2 * len(expected):
        return
    gain = float(expected @ seen) / strength
    if not LIKE_GAINS[0] <= gain <= LIKE_GAINS[1]:
        raise InputError(
            f"{where} moves {gain:.3g} times as far as the model says: it is of another scanner"
            " or axis, or in another unit or sign; give the model of this scanner, drive in V"
            " and displacement in m"
        )
    likeness = gain * np.sqrt(strength / float(seen @ seen))
    if likeness < ALIKE:
        raise InputError(
            f"{where} moves unlike the model (correlation {likeness:.2f}): it is of another"
            " scanner or axis; give the model of this scanner"
        )
