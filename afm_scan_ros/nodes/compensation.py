"""Both axes' inverses on a stream of blocks, within the amplifier's limits."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Any

from attrs import frozen

from afm_scan_ros.core.effects.hysteresis.everett import BeyondRangeError
from afm_scan_ros.core.errors import ScanError
from afm_scan_ros.core.limits import DriveLimits
from afm_scan_ros.core.model import InverseSettings, ScannerModel, compensator
from afm_scan_ros.core.types import AXES, Array, Trace


@frozen(eq=False)
class Progress:
    """How far a stream has come: next drive sample, states and last drive (V) of each axis."""

    next_sample: int
    states: dict[str, Any]
    drive: dict[str, float]


class Compensation:
    """Desired displacement (m) in, drive (V) out, some samples later; the state is passed in.

    ``invert`` and ``finish`` raise ScanError naming sample, axis and value where the drive would
    leave the model's identified range or the amplifier's limits.
    """

    def __init__(
        self,
        model: ScannerModel,
        sample_period: float,
        inverses: Iterable[str],
        settings: InverseSettings,
        limits: DriveLimits,
    ) -> None:
        chosen = frozenset(inverses)
        self._cascades = {
            name: compensator(model.axis(name), sample_period, chosen, settings) for name in AXES
        }
        self._sample_period = sample_period
        self._limits = limits

    def at_rest(self) -> Progress:
        """Return the progress before the first block."""
        states = {name: cascade.inverse_at_rest() for name, cascade in self._cascades.items()}
        return Progress(0, states, dict.fromkeys(AXES, 0.0))

    def invert(self, before: Progress, desired: Trace) -> tuple[Progress, Trace]:
        """Return the progress after a block, and the drive that is known by then."""
        states, drives = {}, {}
        for name, cascade in self._cascades.items():
            with _named(name, before.next_sample):
                states[name], drives[name] = cascade.invert(before.states[name], desired.axis(name))
        return self._advanced(before, states, drives)

    def finish(self, before: Progress) -> Trace:
        """Return the drive still owed after the last block."""
        drives = {}
        for name, cascade in self._cascades.items():
            with _named(name, before.next_sample):
                drives[name] = cascade.finish(before.states[name])
        return self._advanced(before, before.states, drives)[1]

    def _advanced(
        self, before: Progress, states: dict[str, Any], drives: dict[str, Array]
    ) -> tuple[Progress, Trace]:
        drive = Trace(before.next_sample, self._sample_period, drives["x"], drives["y"])
        if not drive.x.size:
            return Progress(before.next_sample, states, before.drive), drive
        self._limits.refuse_beyond(drive, before.drive)
        last = {name: float(drive.axis(name)[-1]) for name in AXES}
        return Progress(before.next_sample + drive.x.size, states, last), drive


@contextmanager
def _named(axis: str, first_sample: int) -> Iterator[None]:
    """Say which axis and which sample of the scan it is that left the identified range."""
    try:
        yield
    except BeyondRangeError as error:
        raise ScanError(
            f"sample {first_sample + error.sample}, axis {axis}: effective input"
            f" {error.value:.6g} V is beyond the identified {error.limit:.6g} V:"
            " scan a smaller range or more slowly"
        ) from error
