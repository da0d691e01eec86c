"""The interface of a scanner driver: drive in, displacement out, and a ramp to rest."""

from abc import ABC, abstractmethod
from importlib import import_module

from attrs import frozen

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import Trace


@frozen
class Displacement:
    """Answer (m) to a block of drive, at the same samples.

    ``measured`` is what the sensor reads; ``true`` has no noise, and only a simulation knows it.
    """

    measured: Trace
    true: Trace | None = None


class Driver(ABC):
    """Owns the outputs of one scanner, in a process without ROS; outputs begin at rest, at 0 V.

    The process makes it from keyword arguments, its settings, and calls ``start`` once, then
    ``advance`` for each block, then ``ramp_down`` once, whatever happened before. All of them are
    called by one thread, in which the watchdog waits too. So no call may block for longer than the
    block lasts, other than in a simulation, whose scanner stands still while it computes.

    ``InputError`` and ``ScanError`` are the errors to raise for what a user can mend; after any
    exception the outputs are ramped down and the scan has failed.
    """

    @abstractmethod
    def start(self, sample_period: float) -> None:
        """Prepare to run at one sample period (s); raises InputError where that is not possible."""

    @abstractmethod
    def advance(self, drive: Trace) -> Displacement:
        """Output a block of drive (V) that follows the last one, and return the displacement.

        Raises ScanError where the scanner cannot follow, or has not been read in time.
        """

    @abstractmethod
    def ramp_down(self) -> float:
        """Ramp the outputs from where they are to rest at 0 V; return how long that took (s)."""


def driver_class(name: str) -> type[Driver]:
    """Return the driver that ``module:Class`` names; raises InputError where there is none."""
    module, _, kind = name.partition(":")
    try:
        found = getattr(import_module(module), kind, None)
    except (ImportError, ValueError) as error:
        raise InputError(f"driver {name}: {error}; give module:Class") from error
    if not (isinstance(found, type) and issubclass(found, Driver)):
        raise InputError(f"driver {name}: {module} has no such driver; give module:Class")
    return found
