"""The part of rclpy's Node that the DDS backend and the one-process backend share."""

from enum import IntEnum

from attrs import frozen

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.files.yaml import Value
from afm_scan_ros.ros.common import Message
from afm_scan_ros.ros.cyclone import names
from afm_scan_ros.ros.cyclone.clock import Clock
from afm_scan_ros.ros.cyclone.log import Logger
from afm_scan_ros.ros.cyclone.names import Arguments
from afm_scan_ros.ros.cyclone.parameters import Parameter, ParameterDescriptor, Parameters


class NotInitializedError(RuntimeError):
    """A node was made or spun before ``init`` or after ``shutdown``."""


class ExternalShutdownException(Exception):  # noqa: N818 - rclpy's name
    """The domain was left while an executor was to wait."""


class InvalidHandle(Exception):  # noqa: N818 - rclpy's name
    """A node was asked for something after ``destroy_node``."""


class SignalHandlerOptions(IntEnum):
    """Which signals ``init`` takes over; here it takes none."""

    NO = 0


@frozen
class TopicEndpointInfo:
    """A publisher or subscription, with what this package's nodes use of rclpy's record."""

    topic_type: str


class NamedNode:
    """A node's name and namespace, its logger, its clock and its parameters."""

    def __init__(self, node_name: str, arguments: Arguments) -> None:
        self._remaps = arguments.remaps
        self._name = names.node_name(node_name, self._remaps)
        self._namespace = names.namespace(node_name, self._remaps)
        self._destroyed = False
        self._logger = Logger(self.get_fully_qualified_name().strip("/").replace("/", "."))
        overrides = arguments.for_node(self.get_fully_qualified_name())
        if overrides.get("use_sim_time"):
            raise InputError("use_sim_time: not supported without ROS 2; remove it")
        self._parameter_overrides = overrides
        self._parameters = Parameters(overrides)

    def get_name(self) -> str:
        """Return the name, after remapping; raises InvalidHandle after ``destroy_node``."""
        if self._destroyed:
            raise InvalidHandle("cannot use Destroyable because destruction was requested")
        return self._name

    def get_namespace(self) -> str:
        """Return the namespace, ``/`` if there is none."""
        return self._namespace

    def get_fully_qualified_name(self) -> str:
        """Return namespace and name."""
        return f"{self._namespace.rstrip('/')}/{self.get_name()}"

    def get_logger(self) -> Logger:
        """Return what writes log lines for this node."""
        return self._logger

    def get_clock(self) -> Clock:
        """Return the node's clock, the system's."""
        return Clock()

    def declare_parameter(
        self, name: str, value: Value, descriptor: Message | None = None
    ) -> Parameter:
        """Declare a parameter with its default; see ``Parameters.declare`` for what it raises."""
        return self._parameters.declare(name, value, descriptor or ParameterDescriptor())

    def has_parameter(self, name: str) -> bool:
        """Return whether a parameter was declared; rclpy declares ``use_sim_time`` by itself."""
        return name == "use_sim_time" or self._parameters.has(name)

    def get_parameter(self, name: str) -> Parameter:
        """Return a declared parameter."""
        return self._parameters.get(name)

    def resolve_topic_name(self, topic: str) -> str:
        """Return the full name of a topic, after remapping."""
        return names.resolve(topic, self.get_name(), self._namespace, self._remaps)

    def expanded(self, topic: str) -> str:
        """Return the full name of a topic, not remapped."""
        return names.resolve(topic, self.get_name(), self._namespace, [])
