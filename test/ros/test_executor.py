"""Contexts and waiting, within one process."""

import threading
from collections.abc import Callable

import pytest

from afm_scan_ros import ros
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.ros.cyclone.base import InvalidHandle
from afm_scan_ros.ros.cyclone.context import NotInitializedError
from afm_scan_ros.ros.cyclone.domain import configuration, domain_id

LATCHED = ros.QoSProfile(depth=1, durability=ros.DurabilityPolicy.TRANSIENT_LOCAL)


def call_back(node: ros.Node, callback: Callable[[], None]) -> None:
    """Let a message of the node's own call back."""
    node.create_publisher(ros.NodeState, "state", LATCHED).publish(ros.NodeState())
    node.create_subscription(ros.NodeState, "state", lambda _: callback(), LATCHED)


def test_what_a_callback_raises_comes_out_of_the_wait(node: ros.Node) -> None:
    def fail() -> None:
        raise InputError("wrong")

    executor = ros.SingleThreadedExecutor()
    executor.add_node(node)
    call_back(node, fail)
    with pytest.raises(InputError, match="wrong"):
        executor.spin_once()


def test_another_thread_ends_a_wait(node: ros.Node) -> None:
    executor = ros.SingleThreadedExecutor()
    executor.add_node(node)
    waker = threading.Timer(0.05, executor.wake)
    waker.start()
    executor.spin_once()  # without a timeout it would never return
    waker.join()


def test_waiting_ends_with_the_domain(node: ros.Node) -> None:
    executor = ros.SingleThreadedExecutor()
    executor.add_node(node)
    call_back(node, ros.shutdown)
    executor.spin()
    assert not ros.ok()
    with pytest.raises(ros.ExternalShutdownException):
        executor.spin_once()


def test_a_node_needs_a_domain() -> None:
    with pytest.raises(NotInitializedError):
        ros.Node("tested")


def test_a_domain_is_joined_anew_with_the_settings_of_the_moment(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    ros.init(args=[])
    ros.shutdown()
    monkeypatch.setenv("CYCLONEDDS_URI", "<CycloneDDS><Nonsense/></CycloneDDS>")
    with pytest.raises(InputError, match="CYCLONEDDS_URI"):
        ros.init(args=[])


@pytest.mark.usefixtures("node")
def test_a_domain_is_joined_once() -> None:
    with pytest.raises(RuntimeError, match="twice"):
        ros.init(args=[])


@pytest.mark.parametrize(
    "environment",
    [
        {"ROS_DOMAIN_ID": "233"},
        {"ROS_DOMAIN_ID": "one"},
        {"ROS_AUTOMATIC_DISCOVERY_RANGE": "EVERYWHERE"},
        {"ROS_STATIC_PEERS": "10.0.0.1"},
    ],
)
def test_an_environment_that_does_not_hold_is_refused(environment: dict[str, str]) -> None:
    with pytest.raises(InputError, match=next(iter(environment))):
        assert domain_id(environment) < len(configuration(environment))


def test_the_users_own_configuration_comes_last() -> None:
    given = configuration({"CYCLONEDDS_URI": "<a/>", "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"})
    assert given.endswith(",<a/>")
    assert "<AllowMulticast>false" in given
    assert "AllowMulticast" not in configuration({})


@pytest.mark.usefixtures("node")
def test_a_node_that_is_destroyed_has_forgotten_its_name() -> None:
    other = ros.Node("destroyed")
    assert other.get_name()
    other.destroy_node()
    for ask in (other.get_name, other.get_fully_qualified_name):
        with pytest.raises(InvalidHandle, match="destruction was requested"):
            ask()
