"""The monitor as a process among others: quiet on the scanner of the model, not on another."""

import re
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from attrs import evolve
from rclpy.node import Node

from afm_scan_ros.cli.options import CONFIG
from afm_scan_ros.cli.processes import NodeProcess
from afm_scan_ros.core.diagnosis.scan_monitor import ScanNews
from afm_scan_ros.core.model import ScannerModel
from afm_scan_ros.files.model_file import load_model, save_model
from afm_scan_ros.nodes.messages import Message
from afm_scan_ros.nodes.peers import RUNNING
from afm_scan_ros.nodes.residual_monitor import ResidualMonitor
from afm_scan_ros.nodes.topics import MODEL_RESIDUAL, NODE_STATE
from helpers.ros import PATIENCE, joined, until

pytestmark = pytest.mark.long

LINES = 6
PACE = {"real_time": False}
"""Parameters of every node of a scan that no clock paces."""
NAME = "residual_monitor"


class Listener(Node):
    """Keeps each line's residual, and what the monitor says of itself."""

    def __init__(self) -> None:
        super().__init__("listener")
        self.lines: list[Message] = []
        self.said: list[tuple[str, str]] = []
        topic = MODEL_RESIDUAL
        self.create_subscription(topic.kind, topic.name, self.lines.append, topic.reader)
        self.create_subscription(NODE_STATE.kind, NODE_STATE.name, self._hear, NODE_STATE.reader)

    def heard(self, said: str) -> bool:
        """Whether the monitor has said something."""
        return any(reason.startswith(said) for _, reason in self.said)

    def _hear(self, message: Message) -> None:
        if message.node == NAME:
            self.said.append((message.state, message.reason))


@pytest.fixture
def listener() -> Iterator[Listener]:
    with joined():
        made = Listener()
        yield made
        made.destroy_node()


Scan = Callable[..., dict[str, NodeProcess]]


@pytest.fixture
def scan(spec: Path, listener: Listener, start: Callable[..., NodeProcess]) -> Scan:
    """Return a function that scans while the monitor looks on; the source waits for others alone.

    It returns all nodes when they have ended.
    """

    def run(plant: Path, model: Path = CONFIG / "model.yaml", watchers: int = 1) -> object:
        required = ["inversion_compensator", "piezoscanner_sim"]
        sim = {"plant_file": str(plant), "min_subscriptions": watchers}
        source = {"required_nodes": required, "time_scale": 0.0, "min_subscriptions": 1}
        nodes = [
            start(NAME, model_file=str(model), min_subscriptions=1, **PACE),
            start("trajectory_generator", spec, **source, **PACE),
        ]
        # The scan waits for its own nodes, and not until a viewer knows of it and is known.
        knows = "waits for one publisher"
        until(lambda: listener.heard(knows) or nodes[0].process.poll() is not None, listener)
        nodes += [
            start("piezoscanner_sim", **sim, min_true_subscriptions=0, **PACE),
            start("inversion_compensator", min_subscriptions=1 + watchers, **PACE),
        ]
        until(lambda: all(node.process.poll() is not None for node in nodes), listener)
        return {node.name: node for node in nodes}

    return run


def failed(nodes: dict[str, NodeProcess]) -> list[str]:
    return [node.last_words() for node in nodes.values() if node.process.wait(PATIENCE)]


def written(node: NodeProcess) -> str:
    node.output.seek(0)
    return node.output.read()


def test_each_line_s_residual_is_published_and_a_healthy_scanner_is_no_news(
    scan: Scan, listener: Listener
) -> None:
    nodes = scan(CONFIG / "plant.yaml")
    assert failed(nodes) == []
    assert [message.line for message in listener.lines] == list(range(LINES))
    assert all(0.0 < m.rms_x < m.max_x < 1e-7 and m.rms_y < m.max_y for m in listener.lines)
    assert {reason for state, reason in listener.said if state in ("running", "done")} == {""}
    said = re.findall(rf"\[{NAME}\]: (.*)", written(nodes[NAME]))  # Fast DDS may write there too
    news = [line.split(" (sample")[0] for line in said]
    assert news[-2:] == ["running", "done"]
    assert "[WARN]" not in written(nodes[NAME])


def test_a_scanner_that_changed_is_told_to_all_and_scans_on(scan: Scan, listener: Listener) -> None:
    nodes = scan(CONFIG / "plants/delay_large.yaml")
    assert failed(nodes) == []
    assert len(listener.lines) == LINES
    alarms = {reason for state, reason in listener.said if state in ("running", "done") and reason}
    assert len(alarms) == 1
    (alarm,) = alarms
    assert alarm.startswith("x: at line 2 the residual is ")
    assert alarm.endswith("Diagnose this scan's bag")
    assert "failed" not in {state for state, _ in listener.said}
    assert written(nodes[NAME]).count("[WARN]") == 1
    assert alarm in written(nodes[NAME])


def test_an_alarm_that_ends_is_told_too(
    listener: Listener,  # noqa: ARG001 - joins the domain
    capfd: pytest.CaptureFixture[str],
) -> None:
    monitor = ResidualMonitor()
    monitor.go(RUNNING)
    capfd.readouterr()
    monitor.announce(ScanNews("x: far off", alarm=True))
    monitor.announce(ScanNews("x: as before"))
    monitor.destroy_node()
    told = [line.split(" ", 3) for line in capfd.readouterr().err.splitlines()]
    assert [(level, news) for level, _, _, news in told] == [
        ("[WARN]", "x: far off"),
        ("[INFO]", "x: as before"),
    ]
    assert monitor.reason == "x: as before"


def without_model_discrepancy(model: ScannerModel) -> ScannerModel:
    return evolve(model, x=evolve(model.x, model_discrepancy=None))


def test_a_model_of_unmodel_discrepancy_is_refused_and_the_scan_goes_on(
    scan: Scan, tmp_path: Path
) -> None:
    model = tmp_path / "model.yaml"
    save_model(model, without_model_discrepancy(load_model(CONFIG / "model.yaml")), "A model.")
    nodes = scan(CONFIG / "plant.yaml", model, watchers=0)
    (said,) = failed(nodes)
    assert nodes[NAME].process.returncode == 2
    assert "states no model_discrepancy" in said
