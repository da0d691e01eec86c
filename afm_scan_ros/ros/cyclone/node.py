"""A node under rclpy's names, with what this package's nodes use of it."""

from collections.abc import Callable

from attrs import frozen

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.files.yaml import Value
from afm_scan_ros.ros.cyclone import names
from afm_scan_ros.ros.cyclone.clock import NANOSECONDS, Clock, Timer
from afm_scan_ros.ros.cyclone.context import current_context
from afm_scan_ros.ros.cyclone.endpoints import (
    Publisher,
    Readable,
    Subscription,
    make_reader,
    make_writer,
)
from afm_scan_ros.ros.cyclone.graph import NodeEndpoints
from afm_scan_ros.ros.cyclone.log import Logger
from afm_scan_ros.ros.cyclone.parameters import Parameter, ParameterDescriptor, Parameters
from afm_scan_ros.ros.cyclone.qos import QoSProfile, profile_of
from afm_scan_ros.ros.cyclone.service import SERVICE_QOS, Client, Service, Trigger
from afm_scan_ros.ros.cyclone.wire import Ending, Reader, Writer
from afm_scan_ros.ros.typing import Message


class InvalidHandle(Exception):  # noqa: N818 - rclpy's name
    """A node was asked for something after ``destroy_node``."""


@frozen
class TopicEndpointInfo:
    """A publisher or subscription, with what this package's nodes use of rclpy's record."""

    topic_type: str


class Node:
    """A named part of the graph that owns publishers, subscriptions, services and timers."""

    def __init__(self, node_name: str) -> None:
        self._context = current_context()
        rules = self._context.arguments.remaps
        self._name = names.node_name(node_name, rules)
        self._namespace = names.namespace(node_name, rules)
        self._destroyed = False
        self._logger = Logger(self.get_fully_qualified_name().strip("/").replace("/", "."))
        overrides = self._context.arguments.for_node(self.get_fully_qualified_name())
        if overrides.get("use_sim_time"):
            raise InputError("use_sim_time: not supported without ROS 2; remove it")
        self._parameter_overrides = overrides
        self._parameters = Parameters(overrides)
        self._shown = NodeEndpoints(self._namespace, self._name)
        self._context.graph.add(self._shown)
        self.timers: list[Timer] = []
        self.readables: list[Readable] = []
        self._endpoints: list[Ending] = []

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
        """Tell whether a parameter was declared; rclpy declares ``use_sim_time`` by itself."""
        return name == "use_sim_time" or self._parameters.has(name)

    def get_parameter(self, name: str) -> Parameter:
        """Return a declared parameter."""
        return self._parameters.get(name)

    def create_publisher(
        self, msg_type: type[Message], topic: str, qos_profile: QoSProfile | int
    ) -> Publisher:
        """Make a publisher of a topic."""
        name, qos = self.resolve_topic_name(topic), profile_of(qos_profile)
        return Publisher(msg_type, name, qos, self._writer(f"rt{name}", msg_type, qos))

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
        name, qos = self.resolve_topic_name(topic), profile_of(qos_profile)
        reader = self._reader(f"rt{name}", msg_type, qos)
        subscription = Subscription(msg_type, name, callback, raw, reader)
        self._await(subscription)
        return subscription

    def create_timer(
        self, timer_period_sec: float, callback: Callable[[], object], *, clock: Clock | None = None
    ) -> Timer:
        """Call back once a period."""
        period = max(1, int(timer_period_sec * NANOSECONDS))
        timer = Timer(period, callback, clock or self.get_clock())
        self.timers.append(timer)
        self._context.wake()
        return timer

    def create_service(
        self,
        srv_type: type[Trigger],
        srv_name: str,
        callback: Callable[[Message, Message], Message],
    ) -> Service:
        """Offer a service."""
        name = self.resolve_topic_name(srv_name)
        reader = self._reader(f"rq{name}Request", srv_type.Request, SERVICE_QOS)
        writer = self._writer(f"rr{name}Reply", srv_type.Response, SERVICE_QOS)
        service = Service(srv_type, callback, reader, writer)
        self._await(service)
        return service

    def create_client(self, srv_type: type[Trigger], srv_name: str) -> Client:
        """Make a client of a service."""
        name = self.resolve_topic_name(srv_name)
        reader = self._reader(f"rr{name}Reply", srv_type.Response, SERVICE_QOS)
        writer = self._writer(f"rq{name}Request", srv_type.Request, SERVICE_QOS)
        client = Client(srv_type, reader, writer)
        self._await(client)
        return client

    def resolve_topic_name(self, topic: str) -> str:
        """Return the full name of a topic, after remapping."""
        rules = self._context.arguments.remaps
        return names.resolve(topic, self.get_name(), self._namespace, rules)

    def count_publishers(self, topic_name: str) -> int:
        """Count the publishers of a topic in all processes; the name is not remapped."""
        return len(self.get_publishers_info_by_topic(topic_name))

    def count_subscribers(self, topic_name: str) -> int:
        """Count the subscriptions to a topic in all processes; the name is not remapped."""
        return len(self._context.graph.readers(f"rt{self._expanded(topic_name)}"))

    def get_publishers_info_by_topic(self, topic_name: str) -> list[TopicEndpointInfo]:
        """Return what is known of each publisher of a topic; the name is not remapped."""
        types = self._context.graph.writers(f"rt{self._expanded(topic_name)}")
        return [TopicEndpointInfo(topic_type=each) for each in types]

    def destroy_node(self) -> None:
        """Take the node and what it owns out of the graph; it calls back and answers no longer."""
        self._destroyed = True
        self._context.graph.remove(self._shown)
        self.timers.clear()
        self.readables.clear()
        for endpoint in self._endpoints:
            endpoint.end()

    def _expanded(self, topic: str) -> str:
        return names.resolve(topic, self.get_name(), self._namespace, [])

    def _reader(self, name: str, message: type[Message], qos: QoSProfile) -> Reader:
        reader = make_reader(self._context.participant, name, message, qos, self._logger)
        self._endpoints.append(reader)
        self._context.graph.add_endpoint(self._shown.readers, reader)
        return reader

    def _writer(self, name: str, message: type[Message], qos: QoSProfile) -> Writer:
        writer = make_writer(self._context.participant, name, message, qos, self._logger)
        self._endpoints.append(writer)
        self._context.graph.add_endpoint(self._shown.writers, writer)
        return writer

    def _await(self, readable: Readable) -> None:
        self.readables.append(readable)
        self._context.wake()
