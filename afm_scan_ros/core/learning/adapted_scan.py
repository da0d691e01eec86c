"""The desired displacement adapted to what was learned from earlier lines, on streams of blocks."""

from collections import deque
from collections.abc import Iterator

from afm_scan_ros.core.align import end, part
from afm_scan_ros.core.learning.adaptation import Adaptation
from afm_scan_ros.core.learning.adapted_reference import ReferenceFilter, Turnarounds
from afm_scan_ros.core.learning.axis_shift import AxisShift
from afm_scan_ros.core.model import ScannerModel
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.types import AXES, Trace


class AdaptedScan:
    """Takes what is desired, and drive and measured displacement, and yields the adapted reference.

    What line k shows is in force from line k + ``delay`` on. A block waits until the lines that it
    depends on were measured, and blocks are cut where a line's parameters come into force. So the
    result depends neither on timing nor on how the signals are cut into blocks.
    """

    def __init__(
        self, model: ScannerModel, spec: ScanSpec, adaptation: Adaptation, delay: int
    ) -> None:
        self.delay, self._adaptation = delay, adaptation
        self._place = Turnarounds(spec)
        period = spec.sample_period
        self._filters = {name: ReferenceFilter(model.axis(name), period) for name in AXES}
        self._states = {name: each.at_rest() for name, each in self._filters.items()}
        self._waiting: deque[Trace] = deque()
        self._measured = 0
        unchanged = dict.fromkeys(AXES, AxisShift().weights)
        self._weights = dict.fromkeys(range(-2, delay), unchanged)

    @property
    def awaited(self) -> int | None:
        """The line that must be measured before more can be adapted; None where none must."""
        if not self._waiting:
            return None
        line = self._place.line_at(self._waiting[0].first_sample)
        return None if line in self._weights else self._measured

    def desired(self, block: Trace) -> Iterator[Trace]:
        """Take the next block of the desired displacement, m; yield what can be adapted."""
        if len(block.x):
            self._waiting.append(block)
        yield from self._adapted()

    def achieved(self, drive: Trace, measured: Trace) -> Iterator[Trace]:
        """Take the next run of drive (V) and measured displacement (m), the same samples of both.

        Yields what can be adapted. Raises BeyondRangeError where the drive leaves the model's
        identified range.
        """
        for line, shifts in self._adaptation.add(drive, measured):
            self._weights[line + self.delay] = {n: shift.weights for n, shift in shifts.items()}
            self._measured = line + 1
        yield from self._adapted()

    def _adapted(self) -> Iterator[Trace]:
        while self._waiting:
            block = self._waiting[0]
            line = self._place.line_at(block.first_sample)
            if line not in self._weights:
                return
            stop = int(min(end(block), self._place.ends(line)))
            self._waiting.popleft()
            if stop < end(block):
                self._waiting.appendleft(part(block, stop, end(block)))
            for old in [each for each in self._weights if each < line - 1]:
                del self._weights[old]
            yield self._filtered(line, part(block, block.first_sample, stop))

    def _filtered(self, line: int, block: Trace) -> Trace:
        """Filter a block that depends on no line after ``line``."""
        adapted = {}
        for name in AXES:
            before, now = (self._weights[each][name] for each in (line - 1, line))
            weights = self._place.weights(line, block.first_sample, len(block.x), before, now)
            state, adapted[name] = self._filters[name].apply(
                self._states[name], block.axis(name), weights
            )
            self._states[name] = state
        return Trace(block.first_sample, block.sample_period, **adapted)
