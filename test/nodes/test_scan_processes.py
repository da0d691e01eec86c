"""The nodes as separate processes that really talk: a scan stopped, and broken."""

import os
import signal
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from rclpy.node import Node
from std_srvs.srv import Trigger

from afm_scan_ros.bag.reader import read_scan
from afm_scan_ros.cli import processes
from afm_scan_ros.cli.processes import NodeProcess
from afm_scan_ros.nodes.messages import Message
from afm_scan_ros.nodes.run import NICENESS
from afm_scan_ros.nodes.topics import NODE_STATE
from helpers.ros import PATIENCE, joined, until

pytestmark = pytest.mark.long

SOURCE = "trajectory_generator"
HELPERS = Path(__file__).parents[1] / "helpers"
CONSUMERS = ("inversion_compensator", "piezoscanner_sim", "scan_recorder")


class Operator(Node):
    """Knows how far each node is, and can ask for a stop."""

    def __init__(self) -> None:
        super().__init__("operator")
        self.samples: dict[str, int] = {}
        self.stop = self.create_client(Trigger, "stop")
        self.create_subscription(NODE_STATE.kind, NODE_STATE.name, self._hear, NODE_STATE.reader)

    def _hear(self, message: Message) -> None:
        self.samples[message.node] = message.next_sample


Nodes = Callable[..., dict[str, NodeProcess]]


@pytest.fixture
def operator() -> Iterator[Operator]:
    with joined():
        made = Operator()
        yield made
        made.destroy_node()


@pytest.fixture
def nodes(start: Callable[..., NodeProcess], spec: Path, tmp_path: Path) -> Nodes:
    """Return a function that starts the nodes of a scan."""

    def run(order: list[str], **source: object) -> dict[str, NodeProcess]:
        own: dict[str, dict[str, object]] = {
            SOURCE: source,
            "scan_recorder": {"bag": str(tmp_path / "bag")},
            "piezoscanner_sim": {"output_log": str(tmp_path / "outputs.txt")},
        }
        files = {SOURCE: spec}
        return {name: start(name, files.get(name), **own.get(name, {})) for name in order}

    return run


def written(node: NodeProcess) -> str:
    node.output.seek(0)
    return node.output.read()


def statuses(nodes: dict[str, NodeProcess]) -> dict[str, int]:
    return {name: node.process.wait(PATIENCE) for name, node in nodes.items()}


def test_a_node_without_a_scan_says_what_it_waits_for_and_why_it_ends(
    nodes: Nodes, operator: Operator
) -> None:
    node = nodes(["piezoscanner_sim"])["piezoscanner_sim"]
    until(lambda: "ready: waits for scan_info" in written(node), operator)
    node.process.send_signal(signal.SIGINT)
    assert node.process.wait(PATIENCE) == 0
    said, last = written(node), written(node).splitlines()[-1]
    assert "/piezoscanner_sim reads /drive_voltage, /node_state, /scan_info; it publishes" in said
    assert last.endswith("ends: interrupted by SIGINT")


def test_a_node_that_keeps_pace_comes_before_usual_work(nodes: Nodes, operator: Operator) -> None:
    """Also where Linux shares the processor among sessions first, each node having its own."""
    node = nodes(["piezoscanner_sim"])["piezoscanner_sim"]
    until(lambda: "ready: waits for scan_info" in written(node), operator)
    if "no priority over other work" in written(node):
        pytest.skip("the system does not permit it")
    assert os.getpriority(os.PRIO_PROCESS, node.process.pid) == NICENESS
    session = Path(f"/proc/{node.process.pid}/autogroup")
    assert not session.exists() or session.read_text("ascii").split()[-1] == str(NICENESS)


def test_a_stop_ends_the_scan_smoothly_at_rest(
    nodes: Nodes, operator: Operator, tmp_path: Path
) -> None:
    started = nodes([SOURCE, *CONSUMERS], time_scale=5.0)
    until(lambda: operator.samples.get("piezoscanner_sim", 0) > 0, operator)
    until(operator.stop.service_is_ready, operator)  # or the request has nobody to reach
    answer = operator.stop.call_async(Trigger.Request())
    until(answer.done, operator)
    assert answer.result().success
    assert statuses(started) == dict.fromkeys(started, 0)
    assert "done: stopped by request at sample" in started[SOURCE].last_words()
    told = written(started["scan_recorder"])
    for news in ("reads /achieved_displacement, ", "ready", "running", "done"):
        assert news in told
    recording = read_scan(tmp_path / "bag")
    desired = recording.whole("desired_displacement")
    assert 0 < desired.x.size < recording.info.total_samples
    assert desired.x[-1] == desired.y[-1] == 0.0
    assert recording.whole("achieved_displacement").x.size == desired.x.size


@pytest.mark.parametrize(
    ("victim", "number", "said"),
    [
        ("scan_recorder", signal.SIGINT, "scan_recorder failed: interrupted by SIGINT"),
        ("piezoscanner_sim", signal.SIGTERM, "piezoscanner_sim failed: interrupted by SIGTERM"),
    ],
)
def test_the_others_say_who_left(
    nodes: Nodes,
    operator: Operator,
    tmp_path: Path,
    victim: str,
    number: signal.Signals,
    said: str,
) -> None:
    started = nodes([SOURCE, *CONSUMERS], time_scale=100.0)
    until(lambda: operator.samples.get("piezoscanner_sim", 0) > 0, operator)
    started[victim].process.send_signal(number)
    ended = statuses(started)
    assert ended == dict.fromkeys(started, 3)
    words = {name: node.last_words() for name, node in started.items()}
    assert all(victim in line for line in words.values())
    assert any(said in line for line in words.values())
    assert f"failed: interrupted by {number.name}" in written(started[victim])
    assert "drive ramped down to 0 V" in words["piezoscanner_sim"]
    assert (tmp_path / "bag/metadata.yaml").is_file()


NODES = [SOURCE, *CONSUMERS]


@pytest.mark.parametrize("victim", CONSUMERS)
def test_a_node_that_is_stopped_is_named_and_not_its_source(
    nodes: Nodes, operator: Operator, victim: str
) -> None:
    started = nodes(NODES, time_scale=4.0)
    until(lambda: operator.samples.get("scan_recorder", 0) > 0, operator)
    started[victim].process.send_signal(signal.SIGSTOP)
    assert_blamed(victim, "has been silent", started)


@pytest.mark.parametrize(
    ("victim", "way", "why"),
    [
        *((victim, "waiting", "has finished no sample for") for victim in NODES),
        ("piezoscanner_sim", "locked", "has been silent"),
    ],
)
def test_a_node_that_hangs_in_its_work_is_named_by_all_others(
    nodes: Nodes, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, victim: str, way: str, why: str
) -> None:
    """The drive comes to rest even where its node is the one that hangs, and nothing else runs."""
    hangs = f"import sys; sys.path.append({str(HELPERS)!r}); import hanging; hanging.start("
    monkeypatch.setattr(processes, "_START", hangs + "'{}', " + f"{victim!r}, {way!r})")
    assert_blamed(victim, why, nodes(NODES))
    assert not np.loadtxt(tmp_path / "outputs.txt", ndmin=2)[-1, 2:].any()


def assert_blamed(victim: str, why: str, nodes: dict[str, NodeProcess]) -> None:
    """All others end, and name the victim and no other for that reason."""
    others = {name: node for name, node in nodes.items() if name != victim}
    assert statuses(others) == dict.fromkeys(others, 3)
    words = {name: written(node) for name, node in others.items()}
    ends = [node.last_words() for node in others.values()]
    assert [said for said in ends if victim not in said] == []
    assert any(f"{victim} {why}" in said for said in words.values())
    innocent = [f"{name} {why}" for name in others]
    assert not [each for each in innocent for said in words.values() if each in said]
