"""The interface of a scanner driver: drive in, sensor readings out, and a ramp to rest."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from importlib import import_module
from inspect import Parameter, signature
from typing import Any, ClassVar, get_type_hints

from attrs import frozen

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import Trace
from afm_scan_ros.drivers.settings import ScannerSettings
from afm_scan_ros.files.records import converted, naming, refuse_unknown

OURS = {
    "simulated": "afm_scan_ros.drivers.simulated:SimulatedScanner",
    "nidaqmx": "afm_scan_ros.drivers.ni:NiDaqmx",
}
"""Short names of the drivers of this package."""
EXTRAS = ("nidaqmx",)
"""Packages that a driver of that name needs, an extra of this package each."""


@frozen
class Reading:
    """Answer to a block of drive, at the same samples.

    ``sensor`` is what the sensor's converter gives (V). ``true`` is the displacement (m) without
    noise, which only a simulation knows.
    """

    sensor: Trace
    true: Trace | None = None


class Driver(ABC):
    """Owns the outputs of one scanner, in a process without ROS; outputs begin at rest, at 0 V.

    The process makes it from the scanner's settings and from its own options, keyword arguments.
    It calls ``start`` once, which leaves the outputs at rest, then ``advance`` for each block. Once
    ``start`` has returned, it calls ``ramp_down`` at the end, whatever happened before. One thread
    calls them, in which the watchdog waits too. A call that does not return in time ends the
    process (``Waits``), and outputs that nobody ramps down stay up. So each wait for the
    hardware needs a bound of its own.

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
    """Return the driver of a short name or of ``module:Class``.

    Raises InputError where there is none.
    """
    known = f"give module:Class, or one of {', '.join(OURS)}"
    module, _, kind = OURS.get(name, name).partition(":")
    try:
        found = getattr(import_module(module), kind, None)
    except ModuleNotFoundError as error:
        raise InputError(f"driver {name}: {error}; {_install(name, error) or known}") from error
    except (ImportError, ValueError) as error:
        raise InputError(f"driver {name}: {error}; {known}") from error
    if not (isinstance(found, type) and issubclass(found, Driver)):
        raise InputError(f"driver {name}: {module} has no such driver; {known}")
    return found


def _install(name: str, error: ModuleNotFoundError) -> str:
    """Return what to install, where a driver's module is there but not what it imports."""
    if error.name == name in EXTRAS:
        return f"pip install 'afm-scan-ros[{name}]'"
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
