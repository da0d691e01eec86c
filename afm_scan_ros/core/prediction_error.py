"""How well a model predicts a motion: by its parameters, and by its error on its records."""

from functools import partial

import numpy as np
from attrs import evolve

from afm_scan_ros.core.bands import rms_by_band
from afm_scan_ros.core.diagnosis.discrepancy import detection_limit
from afm_scan_ros.core.effects.scale import resonance_of
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.extension import SHARE, extended_axis, unknown_beyond
from afm_scan_ros.core.intersample import HELD, held_voltages, moved_by
from afm_scan_ros.core.model import AxisModel, ScannerModel
from afm_scan_ros.core.scanner import forward
from afm_scan_ros.core.spread import Spread, Variant
from afm_scan_ros.core.types import Array, Trace


def standard_deviation(
    model: ScannerModel, drive: Trace, moved: Trace, share: float = SHARE, intersample: str = HELD
) -> Trace:
    """Standard deviation (m) of a motion predicted for a drive (V), without the sensor's noise.

    It is more where the drive leaves the identified range, by a share at most. Of a model without a
    ``Spread`` it is the rms error of the whole motion. Raises InputError where an axis states no
    error.
    """
    given = drive.sample_period, share, intersample
    found = {
        name: _of_axis(model, name, drive.axis(name), moved.axis(name), *given)
        for name in model.axes
    }
    still = np.zeros_like(moved.x)
    return evolve(moved, x=found.get("x", still), y=found.get("y", still))


def _of_axis(
    model: ScannerModel,
    name: str,
    drive: Array,
    moved: Array,
    sample_period: float,
    share: float,
    intersample: str,
) -> Array:
    axis = model.axis(name)
    beyond = unknown_beyond(axis, drive, share)
    if axis.spread is None:
        return np.asarray(np.hypot(_of_records(axis, name, moved, sample_period), beyond))
    known = np.sum(apart(axis, axis.spread, drive, sample_period, share, intersample) ** 2, axis=0)
    left = discrepancy(axis.spread, moved, sample_period)
    return np.asarray(np.sqrt(known + left**2 + beyond**2))


def apart(
    axis: AxisModel,
    spread: Spread,
    drive: Array,
    sample_period: float,
    share: float = SHARE,
    intersample: str = HELD,
) -> Array:
    """What a standard deviation in each direction adds to a prediction (m), (directions, n).

    Effects that were added to the axis are left out: they change it by far less than it is. Where
    no record tells how far the motion lies from rest, it is about the mean.
    """
    given = drive, sample_period, share, intersample
    middle = _moved(axis, spread.centre, *given)
    each = np.array(
        [(_moved(axis, one, *given) - middle) / one.deviations for one in spread.directions]
    ).reshape(-1, len(drive))
    return each if spread.rest_known else each - each.mean(axis=1, keepdims=True)


def discrepancy(spread: Spread, moved: Array, sample_period: float) -> float:
    """Rms error (m) of a predicted motion (m), (n,), beyond what its parameters explain."""
    return float(np.linalg.norm(spread.shares * rms_by_band(moved, spread.bands, sample_period)))


def varied(axis: AxisModel, variant: Variant) -> AxisModel:
    """Return an axis with the effects of a variant, and without any that was added to it."""
    return evolve(
        axis,
        hysteresis=evolve(axis.hysteresis, forward=variant.forward, output=variant.output),
        vibration=variant.vibration,
        creep=variant.creep,
        sensor=variant.sensor,
        added=(),
    )


def _moved(
    axis: AxisModel,
    variant: Variant,
    drive: Array,
    sample_period: float,
    share: float,
    intersample: str,
) -> Array:
    wider = extended_axis(varied(axis, variant), held_voltages(drive, intersample), share)
    return moved_by(partial(forward, wider), drive, sample_period, intersample)


def _of_records(axis: AxisModel, name: str, moved: Array, sample_period: float) -> float:
    """Rms error (m) of a motion by that on the model's records."""
    if not axis.model_discrepancies:
        raise InputError(
            f"the model of axis {name} states no error, so none of a prediction: identify it anew,"
            " with a validation record"
        )
    resonance = resonance_of(axis.vibration, sample_period)
    limit = detection_limit(axis.model_discrepancies, moved, sample_period, resonance)
    return float(np.sqrt(np.sum(np.maximum(limit.rms**2 - limit.noise**2, 0.0))))
