"""The monitor as a process among others: quiet on the scanner of the model, not on another."""

import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from attrs import evolve

from afm_scan_ros import ros
from afm_scan_ros.bag.mcap_file import messages
from afm_scan_ros.cli.options import CONFIG
from afm_scan_ros.cli.orders import ScanFiles
from afm_scan_ros.cli.processes import NodeCommand, NodeProcess
from afm_scan_ros.cli.scan import run_scan
from afm_scan_ros.core.diagnosis.scan_monitor import ScanNews
from afm_scan_ros.core.model import INVERSES, ScannerModel
from afm_scan_ros.files.model_file import load_model, save_model
from afm_scan_ros.nodes.residual_monitor import ResidualMonitor
from afm_scan_ros.nodes.topics import MODEL_RESIDUAL, NODE_STATE, RUNNING

PATIENCE = 60.0
LINES = 6
NAME = "residual_monitor"


class Listener(ros.Node):
    """Keeps each line's residual, and what the monitor says of itself."""

    def __init__(self) -> None:
        super().__init__("listener")
        self.lines: list[ros.Message] = []
        self.said: list[tuple[str, str]] = []
        topic = MODEL_RESIDUAL
        self.create_subscription(topic.kind, topic.name, self.lines.append, topic.reader)
        self.create_subscription(NODE_STATE.kind, NODE_STATE.name, self._hear, NODE_STATE.reader)

    def _hear(self, message: ros.Message) -> None:
        if message.node == NAME:
            self.said.append((message.state, message.reason))


@pytest.fixture
def listener() -> Iterator[Listener]:
    ros.init(args=[], signal_handler_options=ros.SignalHandlerOptions.NO)
    yield Listener()
    ros.shutdown()


def scan(
    spec: Path,
    listener: Listener,
    plant: Path,
    model: Path = CONFIG / "model.yaml",
    watchers: int = 1,
) -> dict[str, NodeProcess]:
    """Scan while the monitor looks on, without the generator waiting for it; return all nodes."""
    source = {"required_nodes": ["inversion_compensator", "piezoscanner_sim"], "time_scale": 0.0}
    sim = {"plant_file": str(plant), "min_subscriptions": watchers, "min_true_subscriptions": 0}
    commands = [
        NodeCommand(NAME, {"model_file": str(model), "min_subscriptions": 1}),
        NodeCommand("piezoscanner_sim", sim),
        NodeCommand("inversion_compensator", {"min_subscriptions": 1 + watchers}),
        NodeCommand("trajectory_generator", source | {"min_subscriptions": 1}, spec),
    ]
    started = {command.name: NodeProcess.start(command) for command in commands}
    executor = ros.SingleThreadedExecutor()
    executor.add_node(listener)
    deadline = time.monotonic() + PATIENCE
    while any(n.process.poll() is None for n in started.values()) and time.monotonic() < deadline:
        executor.spin_once(timeout_sec=0.05)
    return started


def ended(nodes: dict[str, NodeProcess]) -> dict[str, int]:
    return {name: node.process.wait(PATIENCE) for name, node in nodes.items()}


def written(node: NodeProcess) -> str:
    node.output.seek(0)
    return node.output.read()


def test_each_line_s_residual_is_published_and_a_healthy_scanner_is_no_news(
    spec: Path, listener: Listener
) -> None:
    nodes = scan(spec, listener, CONFIG / "plant.yaml")
    assert set(ended(nodes).values()) == {0}
    assert [message.line for message in listener.lines] == list(range(LINES))
    assert all(0.0 < m.rms_x < m.max_x < 1e-7 and m.rms_y < m.max_y for m in listener.lines)
    assert {reason for state, reason in listener.said if state in ("running", "done")} == {""}
    news = [line.split("]: ")[1].split(" (sample")[0] for line in written(nodes[NAME]).splitlines()]
    assert news[-2:] == ["running", "done"]
    assert "[WARN]" not in written(nodes[NAME])


def test_a_scanner_that_changed_is_told_to_all_and_scans_on(spec: Path, listener: Listener) -> None:
    nodes = scan(spec, listener, CONFIG / "plants/delay_large.yaml")
    assert set(ended(nodes).values()) == {0}
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
    spec: Path, listener: Listener, tmp_path: Path
) -> None:
    model = tmp_path / "model.yaml"
    save_model(model, without_model_discrepancy(load_model(CONFIG / "model.yaml")), "A model.")
    nodes = scan(spec, listener, CONFIG / "plant.yaml", model, watchers=0)
    statuses = ended(nodes)
    assert statuses.pop(NAME) == 2
    assert set(statuses.values()) == {0}
    assert "states no model_discrepancy" in nodes[NAME].last_words()


def test_a_watched_scan_tells_its_alarm_and_records_each_line(
    spec: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    plant, bag = CONFIG / "plants/delay_large.yaml", tmp_path / "bag"
    run_scan(ScanFiles(spec, CONFIG / "model.yaml", plant, bag), INVERSES, watched=True)
    said = [line for line in capfd.readouterr().err.splitlines() if line.startswith(f"{NAME}: ")]
    assert len(said) == 1
    assert said[0].endswith("Diagnose this scan's bag")
    topics = [message.topic for message in messages(bag / "bag_0.mcap")]
    assert topics.count("/model_residual") == LINES
