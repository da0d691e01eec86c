"""What a driver returns for a block, checked and as float64 before anything is done with it."""

import math
from numbers import Real

import numpy as np

from afm_scan_ros.core.errors import ScanError
from afm_scan_ros.core.types import AXES, Array, Trace
from afm_scan_ros.drivers import Reading

PERIOD_ROUNDING = 1e-6
"""Relative error of a sample period that was once a float32."""
PLAIN = (np.ndarray, np.memmap, np.ma.MaskedArray)
"""Arrays whose numbers alone say what they hold, as those of a library with units do not."""


def checked(answer: object, drive: Trace, *, knows_true: bool) -> Reading:
    """Return a driver's answer to a block of drive as float64, at the samples of the block.

    Raises ScanError naming the sample, the axis and what does not hold.
    """
    where = f"sample {drive.first_sample}"
    if not isinstance(answer, Reading) or not isinstance(answer.sensor, Trace):
        raise ScanError(f"{where}: advance of the driver must return Reading(Trace(...))")
    sensor = _at_the_samples(answer.sensor, drive, "readings")
    if (answer.true is not None) is not knows_true:
        raise ScanError(
            f"{where}: KNOWS_TRUE of the driver is {knows_true}, but its Reading has"
            f" {'no' if knows_true else 'a'} true displacement"
        )
    if answer.true is None:
        return Reading(sensor)
    true = _at_the_samples(answer.true, drive, "true displacement")
    for axis in AXES:
        if not np.all(finite := np.isfinite(true.axis(axis))):
            place = drive.first_sample + int(np.argmin(finite))
            raise ScanError(f"sample {place}, axis {axis}: the true displacement is not finite")
    return Reading(sensor, true)


def _at_the_samples(given: object, drive: Trace, what: str) -> Trace:
    """Return samples as float64; raises ScanError where they are not those of the drive."""
    where = f"sample {drive.first_sample}: the driver's {what}"
    if not isinstance(given, Trace):
        raise ScanError(f"{where} must be a Trace, and not {_kind(given)}")
    first, period = given.first_sample, given.sample_period
    if not isinstance(first, Real) or first != drive.first_sample:
        raise ScanError(f"{where}: first_sample = {first} is not that of the drive")
    close = isinstance(period, Real) and math.isclose(
        period, drive.sample_period, rel_tol=PERIOD_ROUNDING
    )
    if not close:
        raise ScanError(
            f"{where}: sample_period = {period} is not that of the drive, {drive.sample_period:g}"
        )
    x, y = (_floats(given.axis(axis), drive, what, axis) for axis in AXES)
    return Trace(drive.first_sample, drive.sample_period, x, y)


def _floats(given: Array, drive: Trace, what: str, axis: str) -> Array:
    """Return the samples of an axis as contiguous float64, as they are where they are that."""
    where = f"sample {drive.first_sample}, axis {axis}: the driver's {what}"
    if type(given) not in PLAIN or given.dtype.kind not in "fiu":
        raise ScanError(f"{where} must be a plain array of real numbers, and not {_kind(given)}")
    if given.shape != drive.x.shape:
        raise ScanError(
            f"{where}, of shape {given.shape}, must have that of the drive, {drive.x.shape}"
        )
    if np.ma.is_masked(given):
        place = drive.first_sample + int(np.argmax(np.ma.getmaskarray(given)))
        raise ScanError(f"sample {place}, axis {axis}: masked in the driver's {what}, so none")
    with np.errstate(over="ignore"):  # what no float64 can hold is out of every range
        return np.ascontiguousarray(given, dtype=np.float64)


def _kind(given: object) -> str:
    name = type(given).__name__
    return f"{name} of {given.dtype}" if isinstance(given, np.ndarray) else name
