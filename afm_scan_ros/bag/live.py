"""Writes the bag of a scan that is going on, with all that its monitors find, without nodes."""

import time
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Protocol

from afm_scan_ros.bag import scan_info
from afm_scan_ros.bag.writer import ScanWriter
from afm_scan_ros.core.diagnosis.scan_monitor import ScanMonitor, ScanNews
from afm_scan_ros.core.scan_info import ScanInfo
from afm_scan_ros.core.streams import (
    ACHIEVED,
    DRIVE,
    LineError,
    LineErrors,
    MonitorSample,
    MonitorSamples,
    end,
)
from afm_scan_ros.core.trajectory import phases
from afm_scan_ros.core.types import Trace

TRUE = "true_displacement"


class ScanListener(Protocol):
    """Is told how a scan goes on."""

    def doing(self, what: str) -> None:
        """Hear what is done before the scan begins."""

    def moved(self, sample: int, total: int) -> None:
        """Hear that all samples before this one of so many are achieved."""

    def say(self, news: str) -> None:
        """Hear what the user should know."""


class BlockViewer(Protocol):
    """Sees what a scan records; it must return at once, and raise nothing."""

    def block(self, name: str, block: Trace) -> None:
        """See the next block of a stream."""

    def line(self, name: str, figures: LineError) -> None:
        """See the figures of a line, as of ``model_residual``."""


class LiveWriter(ScanWriter):
    """A bag with a scan that is going on, as the nodes' recorder writes it.

    Each message bears the moment at which it is written.
    """

    def __init__(self, folder: Path, info: ScanInfo, streams: Iterable[str]) -> None:
        super().__init__(folder, info, streams)
        self.add_topic(f"/{scan_info.MONITOR}", scan_info.SAMPLE)
        for name in scan_info.LINE_FIGURES:
            self.add_topic(f"/{name}", scan_info.LINE)

    def add_line(self, name: str, figures: LineError) -> None:
        """Append the figures of one line, as of ``tracking_error``."""
        self.put(name, figures.first_sample, scan_info.encode_line(self._info, figures))

    def add_sample(self, sample: MonitorSample) -> None:
        """Append one sample for viewers."""
        self.put(scan_info.MONITOR, sample.sample, scan_info.encode_sample(self._info, sample))

    def put(self, name: str, sample: int, cdr: bytes) -> None:  # noqa: ARG002 - the interface's
        """Append a message at the moment of this call."""
        self.write(f"/{name}", time.time_ns(), cdr)


class LiveRecorder:
    """Monitors and writes the blocks of a scan, those of a sample's drive before its answer."""

    def __init__(
        self,
        bag: LiveWriter,
        info: ScanInfo,
        listener: ScanListener,
        viewers: Sequence[BlockViewer] = (),
    ) -> None:
        self._bag, self._info, self._listener = bag, info, listener
        self._viewers = viewers
        self._errors: LineErrors | None = None
        if info.spec is not None:
            self._errors = LineErrors(phases(info.spec).lines, info.spec.samples_per_line)
        self._samples = MonitorSamples(info.sample_period)
        self._said = ""

    def add(self, name: str, block: Trace) -> None:
        """Write the next block of a stream, and what follows from it."""
        self._bag.add(name, block)
        if name != TRUE:
            for viewer in self._viewers:
                viewer.block(name, block)
        if name == ACHIEVED:
            self._listener.moved(end(block), self._info.total_samples)
        if self._errors is None or name == TRUE:
            return
        for sample in self._samples.add(name, block):
            self._bag.add_sample(sample)
        for line in self._errors.add(name, block) if name != DRIVE else ():
            self._bag.add_line("tracking_error", line)

    def compare(self, monitor: ScanMonitor, name: str, block: Trace) -> None:
        """Write the residual of each line, and tell once what a healthy scanner does not show."""
        for found in monitor.add(name, block):
            if not isinstance(found, ScanNews):
                self._bag.add_line("model_residual", found)
                for viewer in self._viewers:
                    viewer.line("model_residual", found)
            elif not found.expected and found.text != self._said:
                self._said = found.text
                self._listener.say(f"residual_monitor: {found.text}")
