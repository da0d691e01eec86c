"""Node: publishes the tracking error of each complete line."""

from collections.abc import Iterator

from afm_scan_ros.bag.scan_info import ScanInfo
from afm_scan_ros.core.metrics.line_errors import LineErrors
from afm_scan_ros.core.trajectory import phases
from afm_scan_ros.core.types import Trace
from afm_scan_ros.nodes.block_consumer import min_subscriptions, spec_of
from afm_scan_ros.nodes.messages import tracking_message
from afm_scan_ros.nodes.run import run_node
from afm_scan_ros.nodes.stream_reader import StreamReader
from afm_scan_ros.nodes.topics import ACHIEVED, DESIRED, TRACKING_ERROR, NodeTopic


class TrackingMonitor(StreamReader):
    """Follows what was desired and what was achieved."""

    NAME = "tracking_monitor"
    PARAMETERS = (min_subscriptions(0),)

    def __init__(self) -> None:
        super().__init__()
        self._errors: LineErrors
        self.write(TRACKING_ERROR, self.settings["min_subscriptions"])
        self.read([DESIRED, ACHIEVED])

    def prepare(self, info: ScanInfo) -> Iterator[str]:
        """Learn where the lines lie."""
        spec = spec_of(info)
        self._errors = LineErrors(phases(spec).lines, spec.samples_per_line)
        yield from ()

    def consume(self, topic: NodeTopic, block: Trace, *, last: bool) -> None:  # noqa: ARG002 - lines end by themselves
        """Publish the lines that a block makes whole."""
        for error in self._errors.add(topic.name, block):
            self.publish(TRACKING_ERROR, tracking_message(self.scan, error))


def main() -> int:
    """Run the node."""
    return run_node(TrackingMonitor)
