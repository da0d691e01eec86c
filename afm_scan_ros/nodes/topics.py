"""The topics of a scan, with their message classes and their quality of service."""

from attrs import frozen
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import Image

from afm_scan_ros.msg import (
    DisplacementBlock,
    MonitorSample,
    NodeState,
    ScanInfo,
    TrackingError,
    VoltageBlock,
)
from afm_scan_ros.nodes.messages import Message


def _last(
    depth: int,
    reliability: ReliabilityPolicy = ReliabilityPolicy.RELIABLE,
    durability: DurabilityPolicy = DurabilityPolicy.VOLATILE,
) -> QoSProfile:
    return QoSProfile(
        depth=depth,
        history=HistoryPolicy.KEEP_LAST,
        reliability=reliability,
        durability=durability,
    )


def _latched(depth: int) -> QoSProfile:
    return _last(depth, durability=DurabilityPolicy.TRANSIENT_LOCAL)


# A keep-last reader loses blocks silently, even where delivery is reliable.
_EVERYTHING = QoSProfile(
    history=HistoryPolicy.KEEP_ALL,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.VOLATILE,
)
# One message a line, of which the last ones are kept for a reader that is behind: viewers plot
# them, and one that hangs cannot make the monitor wait.
_LINES = _last(1000)
# Viewers alone read it: none of them can make a node wait.
_FOR_VIEWERS = _last(200, ReliabilityPolicy.BEST_EFFORT)


@frozen(eq=False)
class NodeTopic:
    """A topic by its relative name, so that namespaces and remaps work."""

    name: str
    kind: type[Message]
    writer: QoSProfile
    reader: QoSProfile

    @property
    def type_name(self) -> str:
        """Name of the messages' type, as ``afm_scan_ros/msg/VoltageBlock``."""
        return f"{self.kind.__module__.split('.')[0]}/msg/{self.kind.__name__}"


def _blocks(name: str, kind: type[Message]) -> NodeTopic:
    return NodeTopic(name, kind, _EVERYTHING, _EVERYTHING)


DESIRED = _blocks("desired_displacement", DisplacementBlock)
DRIVE = _blocks("drive_voltage", VoltageBlock)
ACHIEVED = _blocks("achieved_displacement", DisplacementBlock)
TRUE = _blocks("true_displacement", DisplacementBlock)
TRACKING_ERROR = NodeTopic("tracking_error", TrackingError, _LINES, _EVERYTHING)
MODEL_RESIDUAL = NodeTopic("model_residual", TrackingError, _LINES, _EVERYTHING)
MONITOR = NodeTopic("monitor", MonitorSample, _FOR_VIEWERS, _FOR_VIEWERS)
TRACE_IMAGE = NodeTopic("scan_image/trace", Image, _latched(1), _latched(1))
RETRACE_IMAGE = NodeTopic("scan_image/retrace", Image, _latched(1), _latched(1))
SCAN_INFO = NodeTopic("scan_info", ScanInfo, _latched(1), _latched(1))
# Every node writes its own last state; a reader keeps those of many.
NODE_STATE = NodeTopic("node_state", NodeState, _latched(1), _latched(100))
# The last status is all that counts, so no reader can make a node wait.
DIAGNOSTICS = NodeTopic("/diagnostics", DiagnosticArray, _last(1), QoSProfile(depth=100))

BLOCKS = {topic.name: topic for topic in (DESIRED, DRIVE, ACHIEVED, TRUE)}
