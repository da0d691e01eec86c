"""The drive of a scan, block by block: the model's inverses, and what corrects it meanwhile."""

from collections.abc import Generator, Iterable, Iterator
from math import floor, log10

import numpy as np
from attrs import field, frozen

from afm_scan_ros.core.compensation import Compensation, Ranges, largest_ranges, preflight
from afm_scan_ros.core.correction import Correction, Stop
from afm_scan_ros.core.errors import ScanError
from afm_scan_ros.core.limits import DriveLimits
from afm_scan_ros.core.model import InverseSettings, ScannerModel
from afm_scan_ros.core.online import TIME_CONSTANT
from afm_scan_ros.core.online.adaptation import Adaptation
from afm_scan_ros.core.online.adapted_scan import AdaptedScan
from afm_scan_ros.core.online.line_feedback import LEAD, FedBack, LineFeedback, lines_of_delay
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.streams import MAX_BLOCK, cut, end
from afm_scan_ros.core.trajectory import desired
from afm_scan_ros.core.types import Trace


@frozen
class InversionSettings:
    """How a scan is inverted.

    What was achieved corrects the scan with ``line_feedback`` or ``adapt``. Then ``latency`` (s) is
    the longest time from a sample's drive to its reading. ``time_constant`` (s) is the memory with
    which changes are tracked.
    """

    inverses: frozenset[str]
    limits: DriveLimits
    inverse: InverseSettings = field(factory=InverseSettings)
    line_feedback: bool = False
    adapt: bool = False
    latency: float = LEAD
    time_constant: float = TIME_CONSTANT

    @property
    def fed_back(self) -> bool:
        """Whether the drive depends on what was achieved."""
        return self.line_feedback or self.adapt


class ScanInversion:
    """Takes the blocks of one scan, desired and achieved displacement (m); yields the drive (V).

    The drive depends on how the desired displacement is cut into blocks by no more than rounding,
    and on no timing. ``learned`` is what changes the scan's reference, if anything does. ``driven``
    is the first sample whose drive is still to come. Raises InputError for a scan that cannot be
    corrected as the ``settings`` ask.
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
        self._law: LineFeedback | None = None
        self._fed_back: FedBack | None = None
        self._adapted: AdaptedScan | None = None
        if settings.fed_back:
            delay = lines_of_delay(spec, self._compensation.held_back, settings.latency)
        if settings.line_feedback:
            self._law = LineFeedback(spec, delay)
            self._fed_back = FedBack(spec, self._law)
        if settings.adapt:
            adaptation = Adaptation(model, spec, settings.time_constant)
            self._adapted = AdaptedScan(model, spec, adaptation, delay)
        self._stop: Stop = None
        self._end: int | None = None
        self.driven = 0

    @property
    def held_back(self) -> int:
        """Samples by which the drive that is known lags behind the desired displacement."""
        return self._compensation.held_back

    @property
    def remark(self) -> str:
        """What the line feedback can do; nothing without it."""
        if self._law is None:
            return ""
        return (
            f"line feedback: line k is corrected by lines up to k - {self._law.delay}; drifts"
            f" slower than {self._law.bandwidth:.3g} Hz are reduced"
        )

    @property
    def awaited(self) -> int | None:
        """The line that must be achieved before more can be driven; None where none must."""
        waiting = (each.awaited for each in (self._fed_back, self._adapted) if each is not None)
        return min((line for line in waiting if line is not None), default=None)

    def largest_step(self, samples: int) -> float:
        """Return the largest change of the drive (V) from a sample to the next, of the first ones.

        Raises ScanError where it cannot be driven; the inversion is used up.
        """
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

        Raises ScanError naming sample, axis and value where it cannot be driven, and the largest
        range with which it can.
        """
        if self._learned is not None:
            yield from preflight(self._compensation, self._spec, samples, self._learned)
            return
        try:
            yield from preflight(self._compensation, self._spec, samples)
        except ScanError as error:
            found = yield from largest_ranges(self._compensation, self._spec, samples)
            raise ScanError(f"{error}; {_advice(found)}") from error

    def desired(self, block: Trace, *, last: bool) -> Iterator[Trace]:
        """Take the next block of the desired displacement, the ``last`` or not; yield the drive.

        Raises ScanError where it leaves the model's identified range or a limit.
        """
        self._end = end(block) if last else None
        reference = block
        if self._learned is not None:
            self._stop, reference = self._learned.follow(self._stop, block)
        references: Iterable[Trace] = [reference]
        if self._fed_back is not None:
            references = self._fed_back.desired(block, reference)
        yield from self._driven(references)

    def achieved(self, block: Trace) -> Iterator[Trace]:
        """Take the next block of the achieved displacement; yield the drive that waited for it.

        Raises ScanError as ``desired`` does.
        """
        if self._fed_back is not None:
            yield from self._driven(self._fed_back.achieved(block))
        if self._adapted is not None:
            yield from self._inverted(self._adapted.achieved(block))

    def is_last(self, drive: Trace) -> bool:
        """Return whether a block of the drive is the last one."""
        return end(drive) == self._end

    def _driven(self, references: Iterable[Trace]) -> Iterator[Trace]:
        """Yield the drive of what is desired with all corrections but adaptation, and with it."""
        if self._adapted is None:
            yield from self._inverted(references)
            return
        for reference in references:
            yield from self._inverted(self._adapted.desired(reference))

    def _inverted(self, corrected: Iterable[Trace]) -> Iterator[Trace]:
        for block in corrected:
            drive = self._drive(block, last=end(block) == self._end)
            self.driven = end(drive)
            if self._adapted is not None:
                self._adapted.driven(drive)
            yield from cut(drive)

    def _drive(self, block: Trace, *, last: bool) -> Trace:
        """Return the drive known by now; after the last block, the whole rest."""
        try:
            self._progress, drive = self._compensation.invert(self._progress, block)
            owed = self._compensation.finish(self._progress) if last else None
        except ScanError as error:
            raise ScanError(f"{error}{self._corrected_by()}") from error
        if owed is None:
            return drive
        x, y = np.append(drive.x, owed.x), np.append(drive.y, owed.y)
        return Trace(drive.first_sample, drive.sample_period, x, y)

    def _corrected_by(self) -> str:
        if self._fed_back is None:
            return ""
        moved = self._fed_back.corrected_by().items()
        corrections = ", ".join(f"{axis} by {1e6 * offset:.3g} µm" for axis, offset in moved)
        return f"; line feedback corrects {corrections}"


def _advice(ranges: Ranges) -> str:
    if not ranges:
        return "no range is possible, for the preparation alone goes beyond"
    largest = ", ".join(f"{axis} {_rounded_down(1e6 * each):g} µm" for axis, each in ranges.items())
    return f"the largest range of this scan: {largest}"


def _rounded_down(value: float) -> float:
    """Return a number of three digits that is no larger, but for rounding."""
    digit = 10.0 ** (floor(log10(value)) - 2)
    return floor(round(value / digit, 6)) * digit
