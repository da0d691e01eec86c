"""A node under rclpy's names, with what this package's nodes use of it."""

from collections.abc import Callable

from afm_scan_ros.ros.common import Message
from afm_scan_ros.ros.cyclone.base import NamedNode, TopicEndpointInfo
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
from afm_scan_ros.ros.cyclone.messages import Trigger
from afm_scan_ros.ros.cyclone.qos import QoSProfile, profile_of
from afm_scan_ros.ros.cyclone.service import SERVICE_QOS, Client, Service
from afm_scan_ros.ros.cyclone.wire import Ending, Reader, Writer


class Node(NamedNode):
    """A named part of the graph that owns publishers, subscriptions, services and timers."""

    def __init__(self, node_name: str) -> None:
        self._context = current_context()
        super().__init__(node_name, self._context.arguments)
        self._shown = NodeEndpoints(self._namespace, self._name)
        self._context.graph.add(self._shown)
        self.timers: list[Timer] = []
        self.readables: list[Readable] = []
        self.publishers: list[Publisher] = []
        self.subscriptions: list[Subscription] = []
        self._endpoints: list[Ending] = []

    def create_publisher(
        self, msg_type: type[Message], topic: str, qos_profile: QoSProfile | int
    ) -> Publisher:
        """Make a publisher of a topic."""
        name, qos = self.resolve_topic_name(topic), profile_of(qos_profile)
        writer = self._writer(f"rt{name}", msg_type, qos)
        publisher = Publisher(msg_type, name, qos, writer)
        self.publishers.append(publisher)
        return publisher

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
        self.subscriptions.append(subscription)
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

    def count_publishers(self, topic_name: str) -> int:
        """Count the publishers of a topic in all processes; the name is not remapped."""
        return len(self.get_publishers_info_by_topic(topic_name))

    def count_subscribers(self, topic_name: str) -> int:
        """Count the subscriptions to a topic in all processes; the name is not remapped."""
        return len(self._context.graph.readers(f"rt{self.expanded(topic_name)}"))

    def get_publishers_info_by_topic(self, topic_name: str) -> list[TopicEndpointInfo]:
        """Return what is known of each publisher of a topic; the name is not remapped."""
        types = self._context.graph.writers(f"rt{self.expanded(topic_name)}")
        return [TopicEndpointInfo(topic_type=each) for each in types]

    def destroy_node(self) -> None:
        """Remove the node and its entities from the graph; no callback runs afterwards."""
        self._destroyed = True
        self._context.graph.remove(self._shown)
        self.timers.clear()
        self.readables.clear()
        for endpoint in self._endpoints:
            endpoint.end()

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
