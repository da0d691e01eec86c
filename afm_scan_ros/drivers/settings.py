"""The settings of a scanner: its amplifier, its sensor, and the options of its driver."""

import math
from pathlib import Path
from typing import Any

from attrs import field, frozen
from attrs.validators import ge, gt, in_

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.limits import AmplifierSpec
from afm_scan_ros.core.types import Array
from afm_scan_ros.files import yaml
from afm_scan_ros.files.records import from_mapping
from afm_scan_ros.files.share import share_directory

INSTANTS = ("before_update", "after_update")
OPTIONS = "options"
DEFAULTS = {"simulated": "config/simulated_scanner.yaml"}
"""Settings files in the package's share, by the names of drivers."""


def _number(suffix: str, *checks: Any) -> Any:  # noqa: ANN401 - attrs types the field by its annotation
    return field(validator=list(checks), metadata={"suffix": suffix})


@frozen
class AxisSettings:
    """The sensor of one axis: displacement = ``sensor_scale`` x (reading - ``sensor_offset``).

    A negative scale turns the sign. ``sensor_low`` and ``sensor_high`` are the ends of the
    converter's range, where readings are clipped. The channels are for the driver to use.
    """

    sensor_scale: float = _number("_m_per_v")
    sensor_offset: float = _number("_v")
    sensor_low: float = _number("_v")
    sensor_high: float = _number("_v")
    output_channel: str = ""
    input_channel: str = ""

    def __attrs_post_init__(self) -> None:
        if self.sensor_scale == 0.0:
            raise InputError("sensor_scale_m_per_v = 0 makes every displacement 0: give the scale")
        if not self.sensor_low < self.sensor_offset < self.sensor_high:
            raise InputError(
                f"sensor_offset_v = {self.sensor_offset:g} is not between sensor_low_v ="
                f" {self.sensor_low:g} and sensor_high_v = {self.sensor_high:g}: correct them"
            )

    def metres(self, read: Array) -> Array:
        """Return the displacement (m) of readings (V)."""
        return self.sensor_scale * (read - self.sensor_offset)


@frozen
class ScannerSettings:
    """What holds for a scanner, whatever drives it.

    ``latency_samples`` is how many samples later than its displacement a reading is returned.
    ``trigger_offset`` (s) runs from the converter's update to the sensor's sample. The drive moves
    the sensor within ``response_time`` (s) where it changes by more than ``drive_resolution`` (V).
    """

    amplifier: AmplifierSpec
    x: AxisSettings
    y: AxisSettings
    sampling_instant: str = field(validator=in_(INSTANTS))
    latency_samples: int = _number("", ge(0))
    response_time: float = _number("_s", gt(0.0))
    drive_resolution: float = _number("_v", gt(0.0))
    trigger_offset: float = field(default=0.0, metadata={"suffix": "_s"})


@frozen
class DriverChoice:
    """A driver by its name, with the scanner's settings and its own options.

    ``where`` is what errors in the options begin with, as a file's path.
    """

    driver: str
    settings: ScannerSettings
    options: dict[str, Any]
    where: str


def load_settings(driver: str, path: Path) -> DriverChoice:
    """Read the settings of a scanner for its driver.

    The driver's own are in the section ``options:``. They are checked where the driver runs.
    Raises InputError naming the file, the key and the fix.
    """
    content = yaml.load(path)
    options = content.pop(OPTIONS, {})
    if not isinstance(options, dict):
        raise InputError(f"{path}: {OPTIONS} should be a section of 'key: value' lines")
    return DriverChoice(
        driver, from_mapping(ScannerSettings, content, str(path)), options, str(path)
    )


def settings_file(driver: str, given: str) -> Path:
    """Return the settings file of a driver, by default that of this package.

    Raises InputError where there is none.
    """
    if not given and driver in DEFAULTS:
        return share_directory() / DEFAULTS[driver]
    if not given:
        raise InputError(
            f"driver {driver}: it has no settings by default: give a file with those of the"
            " scanner, as stage.yaml"
        )
    return Path(given)


def samples_in(duration: float, sample_period: float) -> int:
    """Return the samples that a duration (s) takes, at least one."""
    return max(1, math.ceil(duration / sample_period))
