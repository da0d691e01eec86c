"""The nodes as separate processes that really talk: a scan whole, stopped, refused, and broken."""

import re
import signal
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from afm_scan_ros import ros
from afm_scan_ros.bag.reader import read_scan
from afm_scan_ros.cli import options
from afm_scan_ros.cli.options import CONFIG
from afm_scan_ros.cli.orders import ScanFiles
from afm_scan_ros.cli.processes import NodeCommand, NodeProcess
from afm_scan_ros.cli.scan import run_scan
from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.trajectory import phases
from afm_scan_ros.nodes.topics import BLOCKS, NODE_STATE
from helpers.viewers import assert_curves_are_recorded, assert_samples_are_of_the_streams

PATIENCE = 60.0
CONSUMERS = ("inversion_compensator", "piezoscanner_sim", "scan_recorder")


def files(spec: Path, bag: Path) -> ScanFiles:
    return ScanFiles(spec, CONFIG / "model.yaml", CONFIG / "plant.yaml", bag)


def test_a_scan_is_recorded_whole_and_follows_what_was_desired(
    spec: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(options, "EVERY", 0.0)  # so that every step is told
    run_scan(files(spec, tmp_path / "bag"), ("creep", "hysteresis", "vibration"))
    told = capsys.readouterr().err
    assert f"scan to {tmp_path / 'bag'}: " in told
    assert re.search(r": \d+%, sample \d+ of \d+ \(\d+ s\)\n", told)
    recording = read_scan(tmp_path / "bag")
    info = recording.info
    assert info.inverses == ("creep", "hysteresis", "vibration")
    streams = {name: recording.whole(name) for name in BLOCKS}
    assert {len(trace.x) for trace in streams.values()} == {info.total_samples}
    assert info.spec is not None
    lines = slice(phases(info.spec).lines.start, phases(info.spec).lines.stop)
    desired, achieved = streams["desired_displacement"], streams["achieved_displacement"]
    error = (achieved.x - desired.x)[lines]
    assert np.sqrt(np.mean(error**2)) < 0.01 * info.spec.range_x
    assert recording.warnings == ()
    assert_curves_are_recorded(tmp_path / "bag")
    assert_samples_are_of_the_streams(tmp_path / "bag", step=100)  # 200 a second of 20 kHz


def test_a_bag_is_never_overwritten(spec: Path, tmp_path: Path) -> None:
    (tmp_path / "bag").mkdir()
    with pytest.raises(InputError, match="bag exists already"):
        run_scan(files(spec, tmp_path / "bag"), ("none",))


def test_a_scan_beyond_the_identified_range_is_refused_before_it_moves(
    spec: Path, tmp_path: Path
) -> None:
    text = spec.read_text("utf-8").replace("range_x_um: 10.0", "range_x_um: 90.0")
    spec.write_text(text, "utf-8")
    largest = r"the largest range of this scan: x \d\d\.\d µm, y 10 µm"
    with pytest.raises(ScanError, match=rf"inversion_compensator: sample \d+, axis x.*; {largest}"):
        run_scan(files(spec, tmp_path / "bag"), ("creep", "hysteresis", "vibration"))
    assert list(tmp_path.iterdir()) == [spec]  # so that a mended scan can have the bag's name


def test_a_scan_beyond_the_amplifier_is_refused_before_it_moves(spec: Path, tmp_path: Path) -> None:
    """The compensator alone knows of 5 V, the plant of less."""
    text = (CONFIG / "plant.yaml").read_text("utf-8")
    text = text.replace("\n  voltage_limit_v: 5.0", "\n  voltage_limit_v: 2.6")
    (plant := tmp_path / "plant.yaml").write_text(text, "utf-8")
    wide = "range_x_um: 45.0\n    preparation: none"
    spec.write_text(spec.read_text("utf-8").replace("range_x_um: 10.0", wide), "utf-8")
    given = ScanFiles(spec, CONFIG / "model.yaml", plant, tmp_path / "bag")
    with pytest.raises(ScanError, match=r"compensator: sample .* amplifier's 2\.6: .*x \d"):
        run_scan(given, ("creep", "hysteresis", "vibration"))
    assert sorted(tmp_path.iterdir()) == [plant, spec]


class Operator(ros.Node):
    """Knows how far each node is, and can ask for a stop."""

    def __init__(self) -> None:
        super().__init__("operator")
        self.samples: dict[str, int] = {}
        self.stop = self.create_client(ros.Trigger, "stop")
        self.create_subscription(NODE_STATE.kind, NODE_STATE.name, self._hear, NODE_STATE.reader)

    def _hear(self, message: ros.Message) -> None:
        self.samples[message.node] = message.next_sample


Spin = Callable[[Callable[[], bool]], None]


@pytest.fixture
def operator() -> Iterator[Operator]:
    ros.init(args=[], signal_handler_options=ros.SignalHandlerOptions.NO)
    yield Operator()
    ros.shutdown()


@pytest.fixture
def spin(operator: Operator) -> Spin:
    """Return a function that listens until something holds."""
    executor = ros.SingleThreadedExecutor()
    executor.add_node(operator)

    def until(holds: Callable[[], bool]) -> None:
        deadline = time.monotonic() + PATIENCE
        while not holds():
            assert time.monotonic() < deadline, "waited in vain"
            executor.spin_once(timeout_sec=0.05)

    return until


@pytest.fixture
def nodes(spec: Path, tmp_path: Path) -> Iterator[Callable[..., dict[str, NodeProcess]]]:
    """Return a function that starts the four nodes of a scan."""
    started: dict[str, NodeProcess] = {}

    def start(order: list[str], **source: object) -> dict[str, NodeProcess]:
        parameters: dict[str, dict[str, object]] = {
            "trajectory_generator": source,
            "scan_recorder": {"bag": str(tmp_path / "bag")},
        }
        for name in order:
            file = spec if name == "trajectory_generator" else None
            patient = {"liveness_timeout_s": 3.0} | parameters.get(name, {})
            started[name] = NodeProcess.start(NodeCommand(name, patient, file))
        return started

    yield start
    for node in started.values():
        node.process.kill()
        node.process.wait()
        node.output.close()


def written(node: NodeProcess) -> str:
    node.output.seek(0)
    return node.output.read()


def statuses(nodes: dict[str, NodeProcess]) -> dict[str, int]:
    return {name: node.process.wait(PATIENCE) for name, node in nodes.items()}


def test_a_node_without_a_scan_says_what_it_waits_for_and_why_it_ends(
    nodes: Callable[..., dict[str, NodeProcess]], spin: Spin
) -> None:
    node = nodes(["piezoscanner_sim"])["piezoscanner_sim"]
    spin(lambda: "ready: waits for scan_info" in written(node))
    node.process.send_signal(signal.SIGINT)
    assert node.process.wait(PATIENCE) == 0
    first, *_, last = written(node).splitlines()
    assert "/piezoscanner_sim reads /drive_voltage, /node_state, /scan_info; it publishes" in first
    assert last.endswith("ends: interrupted by SIGINT")


def test_a_stop_ends_the_scan_smoothly_at_rest(
    nodes: Callable[..., dict[str, NodeProcess]], operator: Operator, spin: Spin, tmp_path: Path
) -> None:
    started = nodes(["trajectory_generator", *CONSUMERS], time_scale=5.0)
    spin(lambda: operator.samples.get("piezoscanner_sim", 0) > 0)
    answer = operator.stop.call_async(ros.Trigger.Request())
    spin(answer.done)
    assert answer.result().success
    assert statuses(started) == dict.fromkeys(started, 0)
    assert "done: stopped by request at sample" in started["trajectory_generator"].last_words()
    told = written(started["scan_recorder"])
    for news in ("reads /achieved_displacement, ", "ready: waits for", "running", "done"):
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
    nodes: Callable[..., dict[str, NodeProcess]],
    operator: Operator,
    spin: Spin,
    tmp_path: Path,
    victim: str,
    number: signal.Signals,
    said: str,
) -> None:
    started = nodes(["trajectory_generator", *CONSUMERS], time_scale=100.0)
    spin(lambda: operator.samples.get("piezoscanner_sim", 0) > 0)
    started[victim].process.send_signal(number)
    ended = statuses(started)
    assert ended == dict.fromkeys(started, 3)
    words = {name: node.last_words() for name, node in started.items()}
    assert all(victim in line for line in words.values())
    assert any(said in line for line in words.values())
    assert f"failed: interrupted by {number.name}" in written(started[victim])
    assert "drive ramped down to 0 V" in words["piezoscanner_sim"]
    assert (tmp_path / "bag/metadata.yaml").is_file()


@pytest.mark.parametrize("victim", ["scan_recorder", "piezoscanner_sim", "inversion_compensator"])
def test_a_node_that_hangs_is_named_and_not_its_source(
    nodes: Callable[..., dict[str, NodeProcess]], operator: Operator, spin: Spin, victim: str
) -> None:
    started = nodes(["trajectory_generator", *CONSUMERS], time_scale=4.0)
    spin(lambda: operator.samples.get("scan_recorder", 0) > 0)
    started[victim].process.send_signal(signal.SIGSTOP)
    generator = started["trajectory_generator"]
    assert generator.process.wait(PATIENCE) == 3
    assert f"{victim} has been silent" in written(generator)
    others = [node for name, node in started.items() if name != victim]
    assert {node.process.wait(PATIENCE) for node in others} == {3}
    assert not any("trajectory_generator has been silent" in written(node) for node in others)
