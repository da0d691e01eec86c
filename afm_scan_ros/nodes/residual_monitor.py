"""Node: monitors the residual of a scan, and raises an alarm above the detection limit."""

from collections.abc import Iterator

from afm_scan_ros.bag.scan_info import encode_line
from afm_scan_ros.core.diagnosis.scan_monitor import ScanMonitor, ScanNews
from afm_scan_ros.core.scan_info import ScanInfo
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.scanner import predict
from afm_scan_ros.core.trajectory import desired
from afm_scan_ros.core.types import Trace
from afm_scan_ros.files.model_file import model_hash
from afm_scan_ros.nodes.block_consumer import StreamReader, min_subscriptions, spec_of
from afm_scan_ros.nodes.inversion_parameters import MONITORING, scan_monitor
from afm_scan_ros.nodes.parameters import MODEL_FILE, model_of
from afm_scan_ros.nodes.peers import RUNNING
from afm_scan_ros.nodes.topics import ACHIEVED, DRIVE, MODEL_RESIDUAL, NodeTopic


class ResidualMonitor(StreamReader):
    """Predicts the displacement from the drive; an alarm is the reason in ``node_state``.

    The scan continues with an alarm, and the state stays ``running``.
    """

    NAME = "residual_monitor"
    PARAMETERS = (MODEL_FILE, *MONITORING, min_subscriptions(0))

    @classmethod
    def warm_up(cls) -> None:
        """Predict a moment of a scan by the default model."""
        super().warm_up()
        model = model_of({MODEL_FILE.name: MODEL_FILE.default})
        predict(model, desired(ScanSpec(), 0, 2))

    def __init__(self) -> None:
        super().__init__()
        self._model = model_of(self.settings)
        self._monitor: ScanMonitor | None = None
        self.write(MODEL_RESIDUAL, self.settings["min_subscriptions"])
        self.read([DRIVE, ACHIEVED])

    def prepare(self, info: ScanInfo) -> Iterator[str]:
        """Compute the places of the lines and their detection limit."""
        spec = spec_of(info)
        if info.model_hash != model_hash(self._model):
            self.get_logger().warning(
                "this scan is compensated with another model than the monitor compares with"
            )
        yield "computing the expected residual"
        self._monitor = scan_monitor(self._model, spec, self.settings)

    def consume(self, topic: NodeTopic, block: Trace, *, last: bool) -> None:  # noqa: ARG002 - lines end by themselves
        """Publish the residuals of the lines that a block completes, and their alarms."""
        if self._monitor is None:
            raise RuntimeError("a block came before the node was ready")
        for found in self._monitor.add(topic.name, block):
            if isinstance(found, ScanNews):
                self.announce(found)
            else:
                self.publish(MODEL_RESIDUAL, encode_line(self.scan, found))

    def go(self, state: str, reason: str = "") -> None:
        """Enter a state; while nothing else is to be said, an alarm that stands is its reason."""
        super().go(state, reason or (self._monitor.alarm if self._monitor else ""))

    def announce(self, news: ScanNews) -> None:
        """Log news, and publish what is not expected in the node's state."""
        if news.alarm:
            self.get_logger().warning(news.text)
        else:  # a place that logs keeps its severity: rclpy refuses another one there
            self.get_logger().info(news.text)
        if not news.expected:
            self.go(RUNNING, news.text)
