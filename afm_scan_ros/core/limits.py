"""How far and how fast a drive may go: what compensator and scanner both keep to."""

import math
from collections.abc import Mapping
from numbers import Real
from typing import Any

import numpy as np
from attrs import Attribute, field, frozen
from attrs.validators import gt

from afm_scan_ros.core.compiled import compiled, inlined
from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.types import AXES, Array, Trace


def _above_zero(_: object, attribute: "Attribute[float]", value: object) -> None:
    if isinstance(value, bool) or not isinstance(value, Real) or not float(value) > 0.0:  # or NaN
        raise InputError(f"{attribute.name} = {value!r}: give a number above 0")


@frozen
class DriveLimits:
    """Largest drive, V, and its steepest slope, V/s, of either axis; InputError unless positive."""

    voltage: float = field(validator=_above_zero)
    slew: float = field(validator=_above_zero)

    def refuse_beyond(self, drive: Trace, before: dict[str, float]) -> None:
        """Raise ScanError for the first sample beyond the voltage or the slew limit, or NaN."""
        limits = drive.sample_period, self.voltage, self.slew
        if _both_keep_to(drive.x, drive.y, before["x"], before["y"], limits):
            return
        for axis in AXES:
            voltage = drive.axis(axis)
            slew = np.diff(voltage, prepend=before[axis]) / drive.sample_period
            for quantity, values, limit in (
                ("drive [V]", voltage, self.voltage),
                ("slope of the drive [V/s]", slew, self.slew),
            ):
                beyond = np.flatnonzero(~(np.abs(values) <= limit))
                if beyond.size:
                    raise ScanError(
                        f"sample {drive.first_sample + beyond[0]}, axis {axis}: {quantity} ="
                        f" {values[beyond[0]]:.6g} is beyond the amplifier's {limit:g}: scan a"
                        " smaller range or more slowly"
                    )


def refuse_step(drive: Trace, before: Mapping[str, float], largest: float) -> None:
    """Raise ScanError for the first sample over ``largest`` (V) from the one before it."""
    for axis in AXES:
        steps = np.abs(np.diff(drive.axis(axis), prepend=before[axis]))
        beyond = np.flatnonzero(~(steps <= largest))
        if beyond.size:
            raise ScanError(
                f"sample {drive.first_sample + beyond[0]}, axis {axis}: the drive changes by"
                f" {steps[beyond[0]]:.3g} V at once, and this scan needs no more than"
                f" {largest:.3g} V"
            )


def _positive(suffix: str) -> Any:  # noqa: ANN401 - attrs types the field by its annotation
    return field(validator=gt(0.0), metadata={"suffix": suffix})


@frozen
class AmplifierSpec:
    """Largest drive (V), its largest slope (V/s), and the slope of an emergency ramp-down."""

    voltage_limit: float = _positive("_v")
    slew_limit: float = _positive("_v_per_s")
    ramp_down_slew: float = _positive("_v_per_s")

    def __attrs_post_init__(self) -> None:
        if self.ramp_down_slew > self.slew_limit:
            raise InputError(
                f"ramp_down_slew = {self.ramp_down_slew:g} V/s exceeds slew_limit ="
                f" {self.slew_limit:g} V/s: lower it"
            )

    @property
    def limits(self) -> DriveLimits:
        """What the amplifier refuses to exceed."""
        return DriveLimits(self.voltage_limit, self.slew_limit)

    @property
    def longest_ramp(self) -> float:
        """Duration (s) of ``ramp_to_rest`` from the voltage limit."""
        return 0.5 * math.pi * self.voltage_limit / self.ramp_down_slew

    def within(self, other: "AmplifierSpec") -> "AmplifierSpec":
        """Return the tighter of both, number by number."""
        slew = min(self.slew_limit, other.slew_limit)
        ramp = min(self.ramp_down_slew, other.ramp_down_slew, slew)
        return AmplifierSpec(min(self.voltage_limit, other.voltage_limit), slew, ramp)


def ramp_to_rest(
    first_sample: int, sample_period: float, before: Mapping[str, float], slew: float
) -> Trace:
    """Drive (V) from ``before`` to rest at zero, as half a cosine of a largest ``slew`` (V/s)."""
    start = np.array([before[axis] for axis in AXES])
    duration = 0.5 * np.pi * np.max(np.abs(start)) / slew
    count = max(1, int(np.ceil(duration / sample_period)))
    fall = 0.5 * (1.0 + np.cos(np.pi * np.arange(1, count + 1) / count))
    return Trace(first_sample, sample_period, start[0] * fall, start[1] * fall)


@inlined
def _keeps_to(values: Array, before: float, limits: tuple[float, float, float]) -> bool:
    """Whether all values and slopes keep to their limits; one pass, without arrays between."""
    period, voltage, slew = limits
    kept = True
    for k in range(values.size):
        slope = (values[k] - (values[k - 1] if k else before)) / period
        kept &= abs(values[k]) <= voltage and abs(slope) <= slew
    return kept


@compiled
def _both_keep_to(
    x: Array, y: Array, x_before: float, y_before: float, limits: tuple[float, float, float]
) -> bool:
    """Whether both axes keep to their limits: sample period (s), voltage (V) and slew (V/s)."""
    return _keeps_to(x, x_before, limits) and _keeps_to(y, y_before, limits)
