"""The node of the Cyclone backend, and its parameters."""

import math
from collections.abc import Callable, Mapping
from enum import IntEnum
from typing import Any, ClassVar

from attrs import Factory, define, frozen

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.files.yaml import Value
from afm_scan_ros.ros.common import Message
from afm_scan_ros.ros.cyclone import base
from afm_scan_ros.ros.cyclone.base import (
    InvalidHandle,
    Logger,
    QoSProfile,
    TopicEndpointInfo,
    profile_of,
)
from afm_scan_ros.ros.cyclone.context import current_context
from afm_scan_ros.ros.cyclone.endpoints import (
    SERVICE_QOS,
    Client,
    Publisher,
    Readable,
    Service,
    Subscription,
)
from afm_scan_ros.ros.cyclone.message_types import ServiceType, message_class

ParameterDescriptor = message_class("rcl_interfaces/msg/ParameterDescriptor")
FloatingPointRange = message_class("rcl_interfaces/msg/FloatingPointRange")
IntegerRange = message_class("rcl_interfaces/msg/IntegerRange")

_TOLERANCE = 1e-6  # rclpy's Node.PARAM_REL_TOL


class ParameterType(IntEnum):
    """Numbers as in rcl_interfaces/ParameterType."""

    BOOL = 1
    INTEGER = 2
    DOUBLE = 3
    STRING = 4
    BOOL_ARRAY = 6
    INTEGER_ARRAY = 7
    DOUBLE_ARRAY = 8
    STRING_ARRAY = 9


_SCALARS = {
    bool: ParameterType.BOOL,
    int: ParameterType.INTEGER,
    float: ParameterType.DOUBLE,
    str: ParameterType.STRING,
}
_ARRAY_OFFSET = ParameterType.BOOL_ARRAY - ParameterType.BOOL


class ParameterException(Exception):  # noqa: N818 - rclpy's name
    """A parameter was declared, given or asked for wrongly."""


class InvalidParameterTypeException(ParameterException):
    """A value of another type than the default's was given, as ``5`` for a double."""


class InvalidParameterValueException(ParameterException):
    """A value outside the declared range was given."""


class ParameterNotDeclaredException(ParameterException):
    """A parameter was asked for that the node has not declared."""


class ParameterAlreadyDeclaredException(ParameterException):
    """A parameter was declared twice."""


@frozen
class Parameter:
    """A name with a value of one of ROS 2's parameter types."""

    Type: ClassVar[type[ParameterType]] = ParameterType
    name: str
    value: Any

    @property
    def type_(self) -> ParameterType:
        """Type of the value; raises ParameterException if ROS 2 has none for it."""
        return _type_of(self.name, self.value)


@define(eq=False)
class Parameters:
    """The parameters of one node, and the values that the command line gave for them."""

    overrides: Mapping[str, Value]
    _declared: dict[str, Parameter] = Factory(dict)

    def declare(self, name: str, default: Value, descriptor: Message) -> Parameter:
        """Return the parameter with the value given for it, else with its default.

        Raises InvalidParameterTypeException and InvalidParameterValueException for a value that
        does not suit, ParameterAlreadyDeclaredException for a name declared before.
        """
        if name in self._declared:
            raise ParameterAlreadyDeclaredException(f"parameter '{name}' is declared already")
        expected = Parameter(name, default).type_
        parameter = Parameter(name, self.overrides.get(name, default))
        if parameter.type_ != expected:
            raise InvalidParameterTypeException(
                f"Trying to set parameter '{name}' to '{parameter.value}' of type"
                f" '{parameter.type_.name}', expecting type '{expected.name}'"
            )
        for limits in (*descriptor.floating_point_range, *descriptor.integer_range):
            _check_range(parameter, limits)
        self._declared[name] = parameter
        return parameter

    def has(self, name: str) -> bool:
        """Return whether a parameter was declared."""
        return name in self._declared

    def get(self, name: str) -> Parameter:
        """Return a declared parameter; raises ParameterNotDeclaredException for any other."""
        if name not in self._declared:
            raise ParameterNotDeclaredException(f"parameter '{name}' is not declared")
        return self._declared[name]


def _type_of(name: str, value: Value) -> ParameterType:
    if type(value) in _SCALARS:
        return _SCALARS[type(value)]
    kinds = {type(item) for item in value} if isinstance(value, (list, tuple)) else set()
    if len(kinds) == 1 and (kind := kinds.pop()) in _SCALARS:
        return ParameterType(_SCALARS[kind] + _ARRAY_OFFSET)
    raise ParameterException(
        f"parameter '{name}' = {value!r}: give a bool, an integer, a double, a string,"
        " or a list of one of them that is not empty"
    )


def _check_range(parameter: Parameter, limits: Message) -> None:
    if parameter.type_ not in (ParameterType.INTEGER, ParameterType.DOUBLE):
        return
    value, low, high = parameter.value, limits.from_value, limits.to_value
    if not (low <= value <= high or _close(value, low) or _close(value, high)):
        raise InvalidParameterValueException(
            f"Invalid parameter value ({value}) for parameter '{parameter.name}'. Reason:"
            f" Parameter {parameter.name} out of range. Min: {low}, Max: {high}, value: {value}"
        )


def _close(value: float, limit: float) -> bool:
    return isinstance(value, float) and math.isclose(value, limit, rel_tol=_TOLERANCE)


class Node:
    """A named part of the graph that owns publishers, subscriptions and services."""

    def __init__(self, node_name: str) -> None:
        self._context = current_context()
        arguments = self._context.arguments
        self._remaps = arguments.remaps
        self._name = base.node_name(node_name, self._remaps)
        self._namespace = base.namespace(node_name, self._remaps)
        self._destroyed = False
        full_name = self.get_fully_qualified_name()
        self._logger = self._context.logger(full_name.strip("/").replace("/", "."))
        self._parameter_overrides = arguments.for_node(full_name)
        if self._parameter_overrides.get("use_sim_time"):
            raise InputError("use_sim_time: not supported without ROS 2; remove it")
        self._parameters = Parameters(self._parameter_overrides)
        self._entities = self._context.entities(self._namespace, self._name, self._logger)
        self.readables: list[Readable] = []
        self.publishers: list[Publisher] = []
        self.subscriptions: list[Subscription] = []

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
        return base.resolve(topic, self.get_name(), self._namespace, self._remaps)

    def create_publisher(
        self, msg_type: type[Message], topic: str, qos_profile: QoSProfile | int
    ) -> Publisher:
        """Make a publisher of a topic."""
        name, qos = self.resolve_topic_name(topic), profile_of(qos_profile)
        writer = self._entities.writer(f"rt{name}", msg_type, qos)
        self.publishers.append(Publisher(msg_type, name, qos, writer))
        return self.publishers[-1]

    def create_subscription(
        self,
        msg_type: type[Message],
        topic: str,
        callback: Callable[[Message], object],
        qos_profile: QoSProfile | int,
        *,
        raw: bool = False,
    ) -> Subscription:
        """Subscribe to a topic."""
        name = self.resolve_topic_name(topic)
        reader = self._entities.reader(f"rt{name}", msg_type, profile_of(qos_profile))
        subscription = Subscription(msg_type, name, callback, raw, reader)
        self.subscriptions.append(subscription)
        self._await(subscription)
        return subscription

    def create_service(
        self,
        srv_type: type[ServiceType],
        srv_name: str,
        callback: Callable[[Message, Message], Message],
    ) -> Service:
        """Offer a service."""
        name = self.resolve_topic_name(srv_name)
        reader = self._entities.reader(f"rq{name}Request", srv_type.Request, SERVICE_QOS)
        writer = self._entities.writer(f"rr{name}Reply", srv_type.Response, SERVICE_QOS)
        service = Service(srv_type, callback, reader, writer)
        self._await(service)
        return service

    def create_client(self, srv_type: type[ServiceType], srv_name: str) -> Client:
        """Make a client of a service."""
        name = self.resolve_topic_name(srv_name)
        reader = self._entities.reader(f"rr{name}Reply", srv_type.Response, SERVICE_QOS)
        writer = self._entities.writer(f"rq{name}Request", srv_type.Request, SERVICE_QOS)
        client = Client(srv_type, reader, writer)
        self._await(client)
        return client

    def count_publishers(self, topic_name: str) -> int:
        """Count the publishers of a topic in all processes; the name is not remapped."""
        return len(self.get_publishers_info_by_topic(topic_name))

    def count_subscribers(self, topic_name: str) -> int:
        """Count the subscriptions to a topic in all processes; the name is not remapped."""
        return len(self._context.reader_types(f"rt{self._expanded(topic_name)}"))

    def get_publishers_info_by_topic(self, topic_name: str) -> list[TopicEndpointInfo]:
        """Return what is known of each publisher of a topic; the name is not remapped."""
        types = self._context.writer_types(f"rt{self._expanded(topic_name)}")
        return [TopicEndpointInfo(topic_type=each) for each in types]

    def get_node_names(self) -> list[str]:
        """Return the names of the nodes in all processes, without their namespaces."""
        return self._context.node_names()

    def destroy_node(self) -> None:
        """Remove the node and its entities from the graph; no callback runs afterwards."""
        self._destroyed = True
        self.readables.clear()
        self._entities.end()

    def _expanded(self, topic: str) -> str:
        """Return the full name of a topic, not remapped."""
        return base.resolve(topic, self.get_name(), self._namespace, [])

    def _await(self, readable: Readable) -> None:
        self.readables.append(readable)
        self._context.wake()
