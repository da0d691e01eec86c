"""Node: publishes the tracking error of each complete line, and single samples for viewers."""

from collections.abc import Iterator
from contextlib import suppress

from rclpy._rclpy_pybind11 import RCLError

from afm_scan_ros.bag.scan_info import decode_block, encode_line, encode_sample
from afm_scan_ros.core.scan_info import ScanInfo
from afm_scan_ros.core.streams import LineErrors, MonitorSamples
from afm_scan_ros.core.trajectory import phases
from afm_scan_ros.core.types import Trace
from afm_scan_ros.nodes.block_consumer import StreamReader, min_subscriptions, spec_of
from afm_scan_ros.nodes.topics import ACHIEVED, DESIRED, DRIVE, MONITOR, TRACKING_ERROR, NodeTopic


class TrackingMonitor(StreamReader):
    """Follows what was desired and what was achieved; the drive is for viewers alone."""

    NAME = "tracking_monitor"
    PARAMETERS = (min_subscriptions(0),)

    def __init__(self) -> None:
        super().__init__()
        self._errors: LineErrors
        self._samples: MonitorSamples
        self._viewers = self.create_publisher(MONITOR.kind, MONITOR.name, MONITOR.writer)
        self.write(TRACKING_ERROR, self.settings["min_subscriptions"])
        self.subscribe(DRIVE, self._hear_drive, raw=True)
        self.read([DESIRED, ACHIEVED])

    def prepare(self, info: ScanInfo) -> Iterator[str]:
        """Learn where the lines lie."""
        spec = spec_of(info)
        self._errors = LineErrors(phases(spec).lines, spec.samples_per_line)
        self._samples = MonitorSamples(info.sample_period)
        yield from ()

    def consume(self, topic: NodeTopic, block: Trace, *, last: bool) -> None:  # noqa: ARG002 - lines end by themselves
        """Publish the lines that a block makes whole, and the samples."""
        for error in self._errors.add(topic.name, block):
            self.publish(TRACKING_ERROR, encode_line(self.scan, error))
        self._show(topic, block)

    def _show(self, topic: NodeTopic, block: Trace) -> None:
        """Publish the samples that a block completes, whether or not anybody gets them."""
        for sample in self._samples.add(topic.name, block):
            with suppress(RCLError):
                self._viewers.publish(encode_sample(self.scan, sample))

    def _hear_drive(self, cdr: bytes, _: int) -> None:
        if self.info is None or self.leaving:
            return
        block = decode_block(DRIVE.type_name, cdr)
        if block.scan_id != self.info.scan_id:
            return
        while self.prepares():
            pass
        self._show(DRIVE, block.trace)
