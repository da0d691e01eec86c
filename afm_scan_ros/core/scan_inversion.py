"""The drive of a scan, block by block: the model's inverses, and what corrects it meanwhile."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Generator, Iterable, Iterator
from math import floor, log10
from typing import TypeAlias

import numpy as np
from attrs import field, frozen

from afm_scan_ros.core.compensation import Compensation, Ranges, largest_ranges, preflight
from afm_scan_ros.core.correction import Correction, Stop
from afm_scan_ros.core.errors import ScanError
from afm_scan_ros.core.limits import DriveLimits
from afm_scan_ros.core.model import InverseSettings, ScannerModel
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.streams import ACHIEVED, DESIRED, DRIVE, MAX_BLOCK, cut, end
from afm_scan_ros.core.trajectory import desired
from afm_scan_ros.core.types import Trace

LATENCY = 0.04
"""Seconds from a sample's drive to its reading: two blocks at 50 blocks a second."""


class OnlineCorrection(ABC):
    """Corrects the reference of a scan by what was achieved; ``remark`` says what it can do."""

    remark = ""

    @property
    @abstractmethod
    def awaited(self) -> int | None:
        """The line that must be achieved before more can be corrected; None where none must."""

    @abstractmethod
    def observe(self, name: str, block: Trace) -> None:
        """Take the next block of a topic, that of a drive before what was achieved under it.

        Raises ScanError where nothing can be learned from the block.
        """

    @abstractmethod
    def corrected(self, references: Iterable[Trace] = ()) -> Iterator[Trace]:
        """Take the next blocks of the reference, m; yield what can be corrected."""

    def effect(self) -> str:
        """Say how the reference is corrected now, for an error that may follow from it."""
        return ""


MakeCorrection: TypeAlias = Callable[[ScannerModel, ScanSpec, int, float], OnlineCorrection]
"""Makes the correction of a scan, from how late what was achieved is known.

The drive is known so many samples after the desired displacement, and a reading so many seconds
after its drive. Raises InputError for a scan that cannot be corrected so.
"""


@frozen
class InversionSettings:
    """How a scan is inverted.

    The ``corrections`` act on its reference one after the other, by what was achieved. ``latency``
    (s) is the longest time from a sample's drive to its reading.
    """

    inverses: frozenset[str]
    limits: DriveLimits
    inverse: InverseSettings = field(factory=InverseSettings)
    corrections: tuple[MakeCorrection, ...] = ()
    latency: float = LATENCY


class ScanInversion:
    """Takes the blocks of one scan, desired and achieved displacement (m); yields the drive (V).

    The drive depends on no timing. ``learned`` changes the scan's reference, if anything does.
    ``driven`` is the first sample whose drive is still to come. Raises InputError for a scan that
    cannot be corrected as the ``settings`` ask.
    """

    def __init__(
        self,
        model: ScannerModel,
        spec: ScanSpec,
        settings: InversionSettings,
        learned: Correction | None = None,
    ) -> None:
        self._spec, self._learned = spec, learned
        self._compensation = Compensation(
            model, spec.sample_period, settings.inverses, settings.inverse, settings.limits
        )
        self._progress = self._compensation.at_rest()
        self._corrections = [
            make(model, spec, self.held_back, settings.latency) for make in settings.corrections
        ]
        self._stop: Stop = None
        self._end: int | None = None
        self.driven = 0

    @property
    def held_back(self) -> int:
        """Samples by which the drive that is known lags behind the desired displacement."""
        return self._compensation.held_back

    @property
    def remark(self) -> str:
        """What the corrections can do, in words."""
        return "; ".join(each.remark for each in self._corrections if each.remark)

    @property
    def awaited(self) -> int | None:
        """The line that must be achieved before more can be driven; None where none must."""
        waiting = (each.awaited for each in self._corrections)
        return min((line for line in waiting if line is not None), default=None)

    def largest_step(self, samples: int) -> float:
        """Return the drive's largest step (V) in the first samples; the inversion is used up."""
        largest, before = 0.0, np.zeros((2, 1))
        for first in range(0, samples, MAX_BLOCK):
            for drive in self.desired(
                desired(self._spec, first, min(MAX_BLOCK, samples - first)), last=False
            ):
                both = np.hstack([before, [drive.x, drive.y]])
                largest = max(largest, float(np.max(np.abs(np.diff(both)), initial=0.0)))
                before = both[:, -1:]
        return largest

    def preflight(self, samples: int) -> Generator[str, None, None]:
        """Invert the first ``samples`` of the scan at rest; yield before each piece what it is.

        Raises ScanError where it cannot be driven, with the largest range with which it can.
        """
        if self._learned is not None:
            yield from preflight(self._compensation, self._spec, samples, self._learned)
            return
        try:
            yield from preflight(self._compensation, self._spec, samples)
        except ScanError as error:
            found = yield from largest_ranges(self._compensation, self._spec, samples)
            raise ScanError(f"{error}; {_advice(self._spec, found)}") from error

    def desired(self, block: Trace, *, last: bool) -> Iterator[Trace]:
        """Take the next desired block, the ``last`` or not; yield the drive, or raise ScanError."""
        self._end = end(block) if last else None
        reference = block
        if self._learned is not None:
            self._stop, reference = self._learned.follow(self._stop, block)
        yield from self._driven(DESIRED, block, [reference])

    def achieved(self, block: Trace) -> Iterator[Trace]:
        """Take the next achieved block; yield the drive that waited for it, as ``desired``."""
        yield from self._driven(ACHIEVED, block, [])

    def is_last(self, drive: Trace) -> bool:
        """Return whether a block of the drive is the last one."""
        return end(drive) == self._end

    def _driven(self, name: str, block: Trace, references: Iterable[Trace]) -> Iterator[Trace]:
        """Yield the drive of references, and of those that waited for a block of a topic."""
        for each in self._corrections:
            each.observe(name, block)
        for each in self._corrections:
            references = each.corrected(references)
        for reference in references:
            drive = self._drive(reference, last=end(reference) == self._end)
            self.driven = end(drive)
            for each in self._corrections:
                each.observe(DRIVE, drive)
            yield from cut(drive)

    def _drive(self, block: Trace, *, last: bool) -> Trace:
        """Return the drive known by now; after the last block, the whole rest."""
        try:
            self._progress, drive = self._compensation.invert(self._progress, block)
            owed = self._compensation.finish(self._progress) if last else None
        except ScanError as error:
            effects = filter(None, (each.effect() for each in self._corrections))
            raise ScanError("; ".join([str(error), *effects])) from error
        if owed is None:
            return drive
        x, y = np.append(drive.x, owed.x), np.append(drive.y, owed.y)
        return Trace(drive.first_sample, drive.sample_period, x, y)


def _advice(spec: ScanSpec, ranges: Ranges) -> str:
    if not ranges:
        return (
            "no range is possible, for the preparation alone goes beyond: give preparation_lower_um"
            " and preparation_upper_um nearer to zero, or centre_x_um and centre_y_um within reach"
        )
    largest = ", ".join(f"{axis} {_rounded_down(1e6 * each):g} µm" for axis, each in ranges.items())
    alone = ranges["x"] >= spec.range_x and ranges["y"] < spec.range_y
    steps = alone and spec.pattern in {"raster", "sinusoidal"}
    longer = ", farther in y with a longer y_step_ms" if steps else ""
    return f"the largest range of this scan: {largest}{longer}"


def _rounded_down(value: float) -> float:
    """Return a number of three digits that is no larger, but for rounding."""
    digit = 10.0 ** (floor(log10(value)) - 2)
    return floor(round(value / digit, 6)) * digit
