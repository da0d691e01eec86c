"""What a model of coupled axes does with arrays that a user gives."""

import numpy as np
from numpy.typing import ArrayLike

from afm_scan_ros.api.arguments import period_of, refuse_other_count, samples
from afm_scan_ros.core.coupled_scanner import CoupledScanner
from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.limits import DriveLimits
from afm_scan_ros.core.types import Array

SAME_PERIOD = 1e-9
"""Relative difference of two sample periods that is rounding."""


def predicted(
    scanner: CoupledScanner, drive: ArrayLike, sample_period: float, *, periodic: bool
) -> Array:
    """Displacement (m) of a drive (V), of its shape; see ``Model.predict``."""
    return scanner.predict(_given(scanner, "drive", drive, sample_period), periodic=periodic)


def inverted(
    scanner: CoupledScanner,
    desired: ArrayLike,
    sample_period: float,
    limits: DriveLimits | None,
    *,
    periodic: bool,
) -> Array:
    """Drive (V) of a displacement (m), of its shape; see ``Model.invert``."""
    target = _given(scanner, "desired", desired, sample_period)
    drive = scanner.invert(target, periodic=periodic)
    if limits is not None:
        _refuse_beyond(scanner, drive, limits)
    return drive


def _given(scanner: CoupledScanner, what: str, given: ArrayLike, sample_period: float) -> Array:
    values = samples(what, given)
    refuse_other_count(what, values, scanner.axes)
    period = period_of(sample_period)
    if abs(period / scanner.sample_period - 1.0) > SAME_PERIOD:
        raise InputError(
            f"sample_period is {period:.9g} s, and the model of coupled axes was identified at"
            f" {scanner.sample_period:.9g} s: resample {what} to that"
        )
    return values


def _refuse_beyond(scanner: CoupledScanner, drive: Array, limits: DriveLimits) -> None:
    """Raise ScanError for the first sample beyond the amplifier's voltage or slew."""
    slope = np.diff(drive, axis=0, prepend=drive[:1]) / scanner.sample_period
    for quantity, values, limit in (
        ("drive [V]", drive, limits.voltage),
        ("slope of the drive [V/s]", slope, limits.slew),
    ):
        beyond = np.argwhere(np.abs(values) > limit)
        if len(beyond):
            sample, channel = beyond[0]
            raise ScanError(
                f"sample {sample}, axis {scanner.axes[channel]}: {quantity} ="
                f" {values[sample, channel]:.6g} is beyond the amplifier's {limit:g}: move less or"
                " more slowly"
            )
