"""The ROS 2 client library: rclpy where it is installed, a replacement elsewhere.

The replacement is the Cyclone backend where Cyclone DDS is installed, else a backend for the nodes
of one process. Only this module knows which one is in use; nodes write
``from afm_scan_ros.ros import Node``. A broken installation of ROS 2 raises here and is not
replaced.
"""

from importlib.util import find_spec
from typing import TYPE_CHECKING

from afm_scan_ros.ros.common import (
    ALONE,
    Message,
    undeclared_parameters,
    use_node_settings,
    users_settings,
)

if TYPE_CHECKING or find_spec("rclpy") is None:
    from afm_scan_ros.ros.cyclone.base import (
        DurabilityPolicy,
        ExternalShutdownException,
        HistoryPolicy,
        QoSProfile,
        RCLError,
        ReliabilityPolicy,
        SignalHandlerOptions,
    )
    from afm_scan_ros.ros.cyclone.context import init, ok, shutdown, try_shutdown
    from afm_scan_ros.ros.cyclone.endpoints import Publisher, Subscription
    from afm_scan_ros.ros.cyclone.executor import SingleThreadedExecutor
    from afm_scan_ros.ros.cyclone.lifecycle import (
        LifecycleNodeMixin,
        LifecycleState,
        TransitionCallbackReturn,
    )
    from afm_scan_ros.ros.cyclone.message_types import (
        DiagnosticArray,
        DiagnosticStatus,
        DisplacementBlock,
        Header,
        Image,
        KeyValue,
        MonitorSample,
        NodeState,
        ScanInfo,
        TrackingError,
        Trigger,
        VoltageBlock,
        deserialize_message,
        serialize_message,
    )
    from afm_scan_ros.ros.cyclone.node import (
        FloatingPointRange,
        IntegerRange,
        Node,
        Parameter,
        ParameterDescriptor,
        ParameterException,
    )
else:
    from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
    from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
    from rclpy import init, ok, shutdown, try_shutdown
    from rclpy._rclpy_pybind11 import RCLError
    from rclpy.exceptions import ParameterException
    from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
    from rclpy.lifecycle import LifecycleNodeMixin, LifecycleState, TransitionCallbackReturn
    from rclpy.node import Node
    from rclpy.parameter import Parameter
    from rclpy.publisher import Publisher
    from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
    from rclpy.serialization import deserialize_message, serialize_message
    from rclpy.signals import SignalHandlerOptions
    from rclpy.subscription import Subscription
    from sensor_msgs.msg import Image
    from std_msgs.msg import Header
    from std_srvs.srv import Trigger

    from afm_scan_ros.msg import (
        DisplacementBlock,
        MonitorSample,
        NodeState,
        ScanInfo,
        TrackingError,
        VoltageBlock,
    )

__all__ = [
    "ALONE",
    "DiagnosticArray",
    "DiagnosticStatus",
    "DisplacementBlock",
    "DurabilityPolicy",
    "ExternalShutdownException",
    "FloatingPointRange",
    "Header",
    "HistoryPolicy",
    "Image",
    "IntegerRange",
    "KeyValue",
    "LifecycleNodeMixin",
    "LifecycleState",
    "Message",
    "MonitorSample",
    "Node",
    "NodeState",
    "Parameter",
    "ParameterDescriptor",
    "ParameterException",
    "Publisher",
    "QoSProfile",
    "RCLError",
    "ReliabilityPolicy",
    "ScanInfo",
    "SignalHandlerOptions",
    "SingleThreadedExecutor",
    "Subscription",
    "TrackingError",
    "TransitionCallbackReturn",
    "Trigger",
    "VoltageBlock",
    "deserialize_message",
    "init",
    "ok",
    "serialize_message",
    "shutdown",
    "try_shutdown",
    "undeclared_parameters",
    "use_node_settings",
    "users_settings",
]
