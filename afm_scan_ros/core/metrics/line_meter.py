"""What only whole lines tell: trace against retrace, and one line against the next."""

from math import sqrt

import numpy as np
from attrs import define, field

from afm_scan_ros.core.metrics.tally import Tally
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.trajectory import phases, sample_kinds
from afm_scan_ros.core.types import Array, Trace
from afm_scan_ros.core.whole_lines import WholeLines


@define
class LineMeter:
    """Gathers the lines of a to-and-fro scan; remembers two of them, however long the scan is."""

    spec: ScanSpec
    mismatch: Tally = field(factory=Tally)
    _jitter_x: Tally = field(factory=Tally)
    _jitter_y: Tally = field(factory=Tally)
    _whole: WholeLines = field(init=False)
    _before: Array | None = None

    def __attrs_post_init__(self) -> None:
        lines = phases(self.spec).lines
        self._whole = WholeLines(lines, self.spec.samples_per_line, 3)

    def add(self, desired: Trace, achieved: Trace) -> None:
        """Take the next run of samples, the same of both; runs follow each other."""
        rows = np.stack([achieved.x, achieved.x - desired.x, achieved.y - desired.y])
        for number, line in self._whole.add(desired.first_sample, rows):
            self._compare(number, line)

    def repeatability(self) -> tuple[float | None, float | None]:
        """Return what differs from line to line in x and in y, m; None before the third line."""
        x, y = (
            tally.rms() / sqrt(2.0) if tally.count else None
            for tally in (self._jitter_x, self._jitter_y)
        )
        return x, y

    def _compare(self, number: int, line: Array) -> None:
        """Compare a line with itself and with the one before; the first one settles."""
        kinds = sample_kinds(self.spec, phases(self.spec).lines.start, line.shape[1])
        if number >= 1:
            forward = np.flatnonzero(kinds.trace)
            forward = forward[forward > 0]
            mirrored = line[0, line.shape[1] - forward]
            self.mismatch = self.mismatch.plus(line[0, forward] - mirrored)
        if self._before is not None:
            change = line[1:, kinds.trace] - self._before[1:, kinds.trace]
            change -= change.mean(axis=1, keepdims=True)
            self._jitter_x = self._jitter_x.plus(change[0])
            self._jitter_y = self._jitter_y.plus(change[1])
        self._before = line.copy() if number >= 1 else None
