"""Drivers of real scanners: what a lab needs to write one of its own.

A driver has settings; drive goes in, readings come out, and it can ramp to rest.
"""

import math
import sys
from abc import ABC, abstractmethod
from collections.abc import Mapping
from importlib import import_module
from inspect import Parameter, signature
from pathlib import Path
from typing import Any, ClassVar, get_type_hints

from attrs import field, frozen
from attrs.validators import ge, gt, in_

from afm_scan_ros import features
from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.limits import AmplifierSpec, ramp_to_rest
from afm_scan_ros.core.types import Array, Trace
from afm_scan_ros.files import share_directory, yaml
from afm_scan_ros.files.records import converted, from_mapping, naming, refuse_unknown

__all__ = [
    "Driver",
    "InputError",
    "Reading",
    "ScanError",
    "ScannerSettings",
    "Trace",
    "ramp_to_rest",
]


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

    def refuse_other_instant(self, instant: str, offset: float) -> None:
        """Raise InputError where the source of a scan states another instant or offset (s)."""
        own = self.settings.sampling_instant, self.settings.trigger_offset
        if own != (instant, offset):
            raise InputError(
                f"{self.where}: samples are taken {own[0]}, with an offset of {own[1]:g} s, but the"
                f" source says {instant}, {offset:g} s: give the source the same sampling_instant"
                " and trigger_offset_s"
            )


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


OURS = {
    "simulated": "afm_scan_ros.drivers.simulated:SimulatedScanner",
    **features.drivers(),
}
"""Short names of the drivers of this package."""
EXTRAS = tuple(features.drivers())
"""Packages that a driver of that name needs, an extra of this package each."""


@frozen
class Reading:
    """Answer to a block of drive, at the same samples.

    ``sensor`` is what the sensor's converter gives (V). ``true`` is the displacement (m) without
    noise, which only a simulation knows. Any plain arrays of real numbers will do.
    """

    sensor: Trace
    true: Trace | None = None


class Driver(ABC):
    """Owns the outputs of one scanner, in a process without ROS; outputs begin at rest, at 0 V.

    The process makes it from the scanner's settings and from its own options, keyword arguments.
    It calls ``start`` once, which leaves the outputs at rest, then ``advance`` for each block. Once
    ``start`` has returned, it calls ``ramp_down`` at the end, whatever happened before. One thread
    calls them, in which the watchdog waits too. A call that returns late (``DriverTimeouts``) is
    followed by ``ramp_down``. One that does not return ends the process, and outputs that nobody
    ramps down stay up. So each wait for the hardware needs a bound of its own.

    ``InputError`` and ``ScanError`` are the errors to raise for what a user can mend; after any
    exception the outputs are ramped down and the scan has failed. The limits of the drive, the
    sensor's unit and latency, and the faults of its readings are not the driver's to handle.
    """

    KNOWS_TRUE: ClassVar[bool] = False
    """Whether each answer has a noise-free displacement."""
    RAMPS_WHILE_BLOCKED: ClassVar[bool] = False
    """Whether ``ramp_down`` may be called by another thread while ``advance`` does not return.

    True is a promise: both wait for no common lock, and ``advance`` outputs nothing from then on.
    """

    def buffered(self, sample_period: float) -> int:  # noqa: ARG002 - for a driver to say
        """Samples of drive in a buffer that the converter outputs first; readings come as late."""
        return 0

    @abstractmethod
    def start(self, sample_period: float) -> None:
        """Prepare to run at one sample period (s); raises InputError where that is not possible."""

    @abstractmethod
    def advance(self, drive: Trace) -> Reading:
        """Output a block of drive (V) that follows the last one, and return the readings.

        Raises ScanError where a sample was not output in time, or not read in time.
        """

    @abstractmethod
    def ramp_down(self) -> float:
        """Ramp the outputs from where they are to rest at 0 V; return how long that took (s)."""


def driver_class(name: str) -> type[Driver]:
    """Return the driver of a short name or of ``module:Class``, also one in the current folder.

    Raises InputError where there is none.
    """
    known = f"give module:Class, or one of {', '.join(OURS)}"
    if name not in OURS:
        sys.path.append(str(Path.cwd()))
    module, _, kind = OURS.get(name, name).partition(":")
    try:
        file = getattr(there := import_module(module), "__file__", None)
        found = getattr(there, kind, None)
    except ModuleNotFoundError as error:
        raise InputError(f"driver {name}: {error}; {_install(name, error) or known}") from error
    except (ImportError, ValueError) as error:
        raise InputError(f"driver {name}: {error}; {known}") from error
    if not (isinstance(found, type) and issubclass(found, Driver)):
        raise InputError(f"driver {name}: {file or module} has no such driver; {known}")
    return found


def _install(name: str, error: ModuleNotFoundError) -> str:
    """Return what to install, where a driver's module is there but not what it imports."""
    if error.name == name in EXTRAS:
        return f"pip install 'afm_scan_ros[{name}]'"
    module = name.partition(":")[0]
    missing = error.name or module
    if f"{module}.".startswith(f"{missing}."):
        return ""
    return f"install {missing}, which {module} imports"


def open_driver(
    kind: type[Driver], settings: ScannerSettings, options: Mapping[str, Any], where: str
) -> Driver:
    """Make a driver; its options are the arguments of its class after the settings.

    Raises InputError naming ``where``, the option and the fix.
    """
    if not (parameters := [*signature(kind).parameters.values()]):
        raise InputError(f"driver {kind.__name__}: its __init__ must take the scanner's settings")
    own = parameters[1:]
    named = {each.name: each for each in own if each.kind is not Parameter.VAR_KEYWORD}
    if len(named) == len(own):
        refuse_unknown(options, named, f"{where}: options")
    for name, each in named.items():
        if each.default is Parameter.empty and name not in options:
            raise InputError(f"{where}: options: key '{name}' is missing; add it")
    hints = get_type_hints(kind.__init__)
    given = {
        name: converted(hints.get(name), value, 1.0, f"{where}: options: {name}")
        for name, value in options.items()
    }
    with naming(f"{where}: options"):
        return kind(settings, **given)  # type: ignore[call-arg] # as the interface demands
