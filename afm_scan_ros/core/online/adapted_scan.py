"""The desired displacement adapted to what was learned from earlier lines, on streams of blocks."""

from collections import deque
from collections.abc import Iterator
from typing import Protocol

import numpy as np

from afm_scan_ros.core.effects.hysteresis.everett import BeyondRangeError
from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.model import ScannerModel
from afm_scan_ros.core.online.adapted_reference import AxisShift, ReferenceFilter
from afm_scan_ros.core.online.line_feedback import CorrectedLines, turn_samples
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.streams import Aligner, end, part
from afm_scan_ros.core.trajectory import TO_AND_FRO, smooth_step
from afm_scan_ros.core.types import AXES, Trace

DRIVE, MEASURED = "drive", "measured"


class LineShifts(Protocol):
    """Estimates the shift of each axis from line to line, as ``Adaptation`` does."""

    def add(self, drive: Trace, measured: Trace) -> Iterator[tuple[int, dict[str, AxisShift]]]:
        """Take the next run of samples; yield each line's number and shifts."""
        ...


class AdaptedScan:
    """Takes what is desired, what was driven and what was measured; yields the adapted reference.

    What line k shows is in force from line k + ``delay`` on. The parameters of a line rise from
    those of the line before in the turn-around before it, with continuous velocity and
    acceleration. A block waits until the lines that it depends on were measured, and blocks are cut
    where a line's parameters come into force. So the result depends neither on timing nor on how
    the signals are cut into blocks. Raises InputError for a scan without turn-arounds.
    """

    def __init__(
        self, model: ScannerModel, spec: ScanSpec, adaptation: LineShifts, delay: int
    ) -> None:
        refuse_without_turns(spec)
        self.delay, self._adaptation = delay, adaptation
        self._place, self._turn = CorrectedLines(spec), turn_samples(spec)
        period = spec.sample_period
        self._filters = {name: ReferenceFilter(model.axis(name), period) for name in AXES}
        self._states = {name: each.at_rest() for name, each in self._filters.items()}
        for name, each in self._filters.items():  # compiled now, not while a scan waits
            each.apply(self._states[name], np.zeros(1), AxisShift().weights[:, None])
        self._waiting: deque[Trace] = deque()
        self._aligner = Aligner((DRIVE, MEASURED))
        unchanged = dict.fromkeys(AXES, AxisShift().weights)
        self._weights = dict.fromkeys(range(-2, delay), unchanged)

    @property
    def awaited(self) -> int | None:
        """The line that must be measured before more can be adapted; None where none must."""
        if not self._waiting:
            return None
        line = self._place.line_at(self._waiting[0].first_sample)
        return None if line in self._weights else line - self.delay

    def desired(self, block: Trace) -> Iterator[Trace]:
        """Take the next block of the desired displacement, m; yield what can be adapted."""
        if len(block.x):
            self._waiting.append(block)
        yield from self._adapted()

    def driven(self, block: Trace) -> None:
        """Take the next block of drive, V, before what was measured under it."""
        self._aligner.add(DRIVE, block)

    def achieved(self, block: Trace) -> Iterator[Trace]:
        """Take the next block of measured displacement, m; yield what can be adapted.

        Raises ScanError where the drive leaves the model's identified range.
        """
        self._aligner.add(MEASURED, block)
        for drive, measured in self._aligner.ready():
            try:
                self._learn(drive, measured)
            except BeyondRangeError as error:
                sample = drive.first_sample + error.sample
                raise ScanError(f"sample {sample}: adaptation predicts nothing: {error}") from error
        yield from self._adapted()

    def _learn(self, drive: Trace, measured: Trace) -> None:
        for line, shifts in self._adaptation.add(drive, measured):
            weights = {name: shift.weights for name, shift in shifts.items()}
            self._weights[line + self.delay] = weights

    def _adapted(self) -> Iterator[Trace]:
        while self._waiting:
            line = self._place.line_at(self._waiting[0].first_sample)
            if line not in self._weights:
                return
            block = self._waiting.popleft()
            now = self._place.part_of(line, block)
            if end(now) < end(block):
                self._waiting.appendleft(part(block, end(now), end(block)))
            for old in [each for each in self._weights if each < line - 1]:
                del self._weights[old]
            yield self._filtered(line, now)

    def _filtered(self, line: int, block: Trace) -> Trace:
        """Filter a block that has one line's parameters throughout."""
        samples = np.arange(block.first_sample, end(block))
        rise = smooth_step((samples - self._place.begins(line)) / (2.0 * self._turn))
        adapted = {}
        for name in AXES:
            before, now = (self._weights[each][name] for each in (line - 1, line))
            weights = before[:, None] + rise * (now - before)[:, None]
            self._states[name], adapted[name] = self._filters[name].apply(
                self._states[name], block.axis(name), weights
            )
        return Trace(block.first_sample, block.sample_period, **adapted)


def refuse_without_turns(spec: ScanSpec) -> None:
    """Raise InputError for a scan without turn-arounds, in which parameters could change."""
    if spec.pattern not in TO_AND_FRO:
        raise InputError(
            f"adaptation is for {' and '.join(TO_AND_FRO)} scans, not '{spec.pattern}': choose"
            " one of these, or scan without it"
        )
    if not spec.turnaround:
        raise InputError(
            "turnaround = 0 leaves adaptation no time to change its parameters: give 0.1, or"
            " scan without it"
        )
