"""The scanner's node is managed as any of ROS: by its services, and safe whatever it is told."""

import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from attrs import evolve
from lifecycle_msgs.msg import Transition, TransitionEvent
from lifecycle_msgs.srv import ChangeState, GetAvailableStates, GetAvailableTransitions, GetState
from rclpy.node import Node

from afm_scan_ros.bag.reader import read_scan
from afm_scan_ros.bag.scan_info import encode_block
from afm_scan_ros.cli.processes import NodeProcess
from afm_scan_ros.core.errors import ScanError
from afm_scan_ros.core.scan_info import ScanInfo
from afm_scan_ros.core.types import AXES, Trace
from afm_scan_ros.nodes.messages import Message
from afm_scan_ros.nodes.peers import FAILED, RUNNING, Report
from afm_scan_ros.nodes.scanner_node import PiezoscannerSim
from afm_scan_ros.nodes.topics import ACHIEVED, DRIVE, NODE_STATE
from afm_scan_ros.simulation.scanner import Piezoscanner
from helpers.in_process import default_plant
from helpers.ros import PATIENCE, joined, until

pytestmark = pytest.mark.long

EVIDENCE = pytest.mark.evidence
INFO = ScanInfo("tested", 10**18, "creep", 1e-4, 4000, window=4000, nodes=("source",))
NAME = "piezoscanner_sim"


class Operator(Node):
    """Manages the scanner as ``ros2 lifecycle`` does, and hears of its states."""

    def __init__(self) -> None:
        super().__init__("operator")
        self.said: dict[str, Message] = {}
        self.goals: list[str] = []
        topic = NODE_STATE
        self.create_subscription(topic.kind, topic.name, self._hear, topic.reader)
        self.create_subscription(
            TransitionEvent,
            f"{NAME}/transition_event",
            lambda message: self.goals.append(message.goal_state.label),
            10,
        )
        self.beside: list[Node] = []

    def _hear(self, message: Message) -> None:
        self.said[message.node] = message

    def call(self, service: str, kind: type, **fields: object) -> Message:
        client = self.create_client(kind, f"{NAME}/{service}")
        self.until(client.service_is_ready)
        future = client.call_async(kind.Request(**fields))
        self.until(future.done)
        return future.result()

    def state(self) -> str:
        return str(self.call("get_state", GetState).current_state.label)

    def change(self, label: str = "", number: int = 0) -> bool:
        asked = Transition(id=number, label=label)
        return bool(self.call("change_state", ChangeState, transition=asked).success)

    def possible(self, service: str) -> list[str]:
        found = self.call(service, GetAvailableTransitions).available_transitions
        return [each.transition.label for each in found]

    def reason(self, node: str = NAME) -> str:
        return str(self.said[node].reason) if node in self.said else ""

    def until(self, holds: Callable[[], bool]) -> None:
        until(holds, self, *self.beside)


@pytest.fixture
def operator() -> Iterator[Operator]:
    """Nodes of this process wait to be configured; those that are started need not."""
    with joined(autostart=False):
        made = Operator()
        yield made
        made.destroy_node()


Start = Callable[..., NodeProcess]


def test_a_scan_by_hand_is_the_same_to_the_bit(
    operator: Operator, start: Start, spec: Path, tmp_path: Path
) -> None:
    """The other nodes wait for the scanner, which opens its driver twice."""
    nodes = [
        start(NAME, autostart=False),
        start("scan_recorder", bag=str(tmp_path / "bag")),
        start("inversion_compensator"),
        start("trajectory_generator", spec, time_scale=0.2),
    ]
    assert operator.state() == "unconfigured"
    assert operator.possible("get_available_transitions") == ["configure", "shutdown"]
    assert not operator.change("activate")
    for label in ("configure", "cleanup", "configure"):
        assert operator.change(label)
    assert operator.state() == "inactive"
    operator.until(lambda: operator.reason() == "waits to be activated")
    operator.until(lambda: operator.reason("trajectory_generator") != "")
    assert operator.said["trajectory_generator"].state == "ready"
    assert operator.change(number=3)
    assert [node.process.wait(PATIENCE) for node in nodes] == [0, 0, 0, 0]
    recording = read_scan(tmp_path / "bag")
    drive, found = (recording.whole(name) for name in (DRIVE.name, ACHIEVED.name))
    assert drive.x.size == recording.info.total_samples
    expected, _ = Piezoscanner(default_plant(), drive.sample_period, seed=1).advance(drive)
    for axis in AXES:
        np.testing.assert_array_equal(found.axis(axis), expected.axis(axis))
    assert operator.goals[:6] == [
        *("configuring", "inactive", "cleaningup", "unconfigured", "configuring", "inactive"),
    ]


@pytest.mark.parametrize("label", ["deactivate", pytest.param("shutdown", marks=EVIDENCE)])
def test_a_scanner_that_is_deactivated_ramps_down_and_ends_the_scan(
    operator: Operator, start: Start, spec: Path, tmp_path: Path, label: str
) -> None:
    scanner = start(NAME)
    start("scan_recorder", bag=str(tmp_path / "bag"))
    start("inversion_compensator")
    source = start("trajectory_generator", spec, time_scale=100.0)
    operator.until(lambda: NAME in operator.said and operator.said[NAME].next_sample > 0)
    assert operator.change(label)
    operator.until(lambda: operator.said[NAME].state == FAILED)
    assert operator.reason().startswith("deactivated at sample ")
    assert "drive ramped down to 0 V" in operator.reason()
    assert (scanner.process.wait(PATIENCE), source.process.wait(PATIENCE)) == (3, 3)
    assert f"{NAME} failed: deactivated at sample" in source.last_words()


class Faulty(PiezoscannerSim):
    """Opens nothing."""

    def open(self) -> None:
        raise RuntimeError("a fault of the program")


class Starving(PiezoscannerSim):
    """Its driver is the first to miss the drive."""

    def _serve_driver(self) -> None:
        self._advanced -= 10.0
        raise ScanError("no drive for 0.35 s")


@pytest.mark.parametrize("silent", [True, False])
def test_the_name_of_a_silent_node_follows_where_the_driver_misses_the_drive_first(
    operator: Operator, *, silent: bool
) -> None:
    node = Starving()
    operator.beside.append(node)
    node.begin(evolve(INFO, nodes=("source", NAME)))
    now = time.monotonic()
    node.state = RUNNING
    node.peers.listen_anew(now)  # as after a pause, since which nothing is decided by silence
    last = now - 10.0 if silent else now
    node.peers.hear(Report("source", INFO.scan_id, RUNNING, 1000, "", last))
    with pytest.raises(ScanError) as caught:
        node.step()
    named = "; source has been silent for 10 s" if silent else ""
    assert str(caught.value) == f"no drive for 0.35 s{named}"
    node.destroy_node()


def test_an_error_in_a_transition_ends_the_node(operator: Operator) -> None:
    node = Faulty()
    operator.beside.append(node)
    operator.until(lambda: operator.count_publishers(f"/{NAME}/transition_event") == 1)
    assert not operator.change("configure")
    assert (node.state, node.status, node.leaving) == (FAILED, 1, True)
    assert node.reason == "RuntimeError: a fault of the program"
    operator.until(lambda: operator.goals == ["configuring", "errorprocessing", "finalized"])
    node.destroy_node()  # shut down already


def test_a_node_that_is_shut_down_ends_well(operator: Operator, start: Start) -> None:
    node = start(NAME)
    operator.until(lambda: operator.reason() == "waits for scan_info")
    assert operator.state() == "active"
    assert operator.change("shutdown")
    assert node.process.wait(PATIENCE) == 0
    assert "Traceback" not in node.ended().traceback


def test_a_transition_that_is_impossible_keeps_the_node_alive(
    operator: Operator, start: Start
) -> None:
    """Rclpy by itself raises, which would end it."""
    node = start(NAME)
    operator.until(lambda: operator.reason() == "waits for scan_info")
    for label in ("configure", "activate", "cleanup", "nonsense"):
        assert not operator.change(label)
    assert operator.state() == "active"
    assert node.process.poll() is None


def test_a_block_before_the_scanner_is_active_moves_nothing(operator: Operator) -> None:
    assert operator.said == {}
    node = PiezoscannerSim()
    node.begin(evolve(INFO, nodes=("source", NAME)))
    block = Trace(0, INFO.sample_period, np.ones(10), np.ones(10))
    said = "drive_voltage: a block came while this node waits to be configured"
    with pytest.raises(ScanError, match=f"^{said}$"):
        node.receive(DRIVE, encode_block(DRIVE.type_name, INFO, block, last=False), 1)
    node.destroy_node()
    assert (node.state, node.reason) == (FAILED, "deactivated at sample 0")


def test_the_states_and_services_are_those_of_ros(operator: Operator) -> None:
    node = PiezoscannerSim()
    operator.beside.append(node)
    assert operator.change("configure")
    assert operator.change("activate")
    assert operator.state() == "active"
    found = operator.call("get_available_states", GetAvailableStates).available_states
    assert [(each.id, each.label) for each in found][:5] == [
        *((0, "unknown"), (1, "unconfigured"), (2, "inactive"), (3, "active"), (4, "finalized")),
    ]
    assert len(found) == 11
    graph = operator.call("get_transition_graph", GetAvailableTransitions)
    numbers = [each.transition.id for each in graph.available_transitions]
    assert numbers == [
        *(1, 10, 11, 12, 2, 20, 21, 22, 3, 30, 31, 32, 4, 40, 41, 42),
        *(5, 6, 7, 50, 51, 52, 60, 61, 62),
    ]
    assert operator.possible("get_available_transitions") == ["deactivate", "shutdown"]
    for label in ("deactivate", "cleanup", "shutdown"):
        assert operator.change(label)
    assert (node.leaving, node.status) == (True, 0)
    node.destroy_node()
