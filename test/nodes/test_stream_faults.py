"""What goes wrong on a topic stops the scan, with an error that names it."""

from collections.abc import Callable, Iterator
from pathlib import Path
from threading import Event, Thread

import numpy as np
import pytest
from attrs import evolve

from afm_scan_ros import ros
from afm_scan_ros.bag.scan_info import ScanInfo
from afm_scan_ros.core.types import Trace
from afm_scan_ros.nodes import scan_node
from afm_scan_ros.nodes.messages import block_message, info_message, state_message
from afm_scan_ros.nodes.run import live
from afm_scan_ros.nodes.scan_recorder import ScanRecorder
from afm_scan_ros.nodes.topics import DESIRED, DRIVE, NODE_STATE, SCAN_INFO

INFO = ScanInfo(
    "tested", 10**18, "creep", 1e-4, 4000, window=4000, nodes=("source", "scan_recorder")
)
Messages = Callable[[], list[ros.Message]]


def block(first: int, info: ScanInfo = INFO, value: float = 0.0) -> ros.Message:
    samples = np.full(100, value)
    return block_message(
        DESIRED.kind, info, Trace(first, info.sample_period, samples, samples), last=False
    )


class Source(ros.Node):
    """Announces a scan, and sends its messages once the recorder is ready, by turns."""

    def __init__(self, messages: list[ros.Message], *more: type[ros.Message]) -> None:
        super().__init__("source")
        self._messages = messages
        self._ready = False
        self._state = self.create_publisher(NODE_STATE.kind, NODE_STATE.name, NODE_STATE.writer)
        self._info = self.create_publisher(SCAN_INFO.kind, SCAN_INFO.name, SCAN_INFO.writer)
        self._blocks = [
            self.create_publisher(kind, DESIRED.name, DESIRED.writer)
            for kind in (DESIRED.kind, *more)
        ]
        self.create_subscription(NODE_STATE.kind, NODE_STATE.name, self._hear, NODE_STATE.reader)
        self._info.publish(info_message(INFO))
        self._ended = Event()
        self._acting = Thread(target=self._act)
        self._acting.start()

    def destroy_node(self) -> None:
        self._ended.set()
        self._acting.join()
        super().destroy_node()

    def _hear(self, message: ros.Message) -> None:
        if message.node == "scan_recorder" and message.scan_id == INFO.scan_id:
            self._ready = True

    def _act(self) -> None:
        while not self._ended.wait(0.05):
            self._state.publish(state_message(INFO, "source", "running", 0, ""))
            if self._ready and self._messages:
                self._blocks[0].publish(self._messages.pop(0))


@pytest.fixture
def recorded(tmp_path: Path) -> Iterator[Callable[..., ScanRecorder]]:
    """Return a function that lets a recorder follow a source until it ends."""
    given = [f"bag:={tmp_path / 'bag'}", "topics:=[desired_displacement]"]
    words = [word for pair in given for word in ("-p", pair)]
    ros.init(
        args=["test", "--ros-args", *words], signal_handler_options=ros.SignalHandlerOptions.NO
    )

    def follow(messages: list[ros.Message], *more: type[ros.Message]) -> ScanRecorder:
        recorder, source = ScanRecorder(), Source(messages, *more)
        executor = ros.SingleThreadedExecutor()
        executor.add_node(source)
        executor.add_node(recorder)
        live(recorder, executor, [])
        executor.shutdown()
        source.destroy_node()
        recorder.destroy_node()
        return recorder

    yield follow
    ros.shutdown()


@pytest.mark.parametrize(
    ("second", "named"),
    [
        (block(200), "samples 100 to 199 are missing"),
        (block(0), "sample 0 came again"),
        (block(100, evolve(INFO, sample_period=2e-4)), "sample period changed"),
        (block(100, evolve(INFO, scan_id="older")), "a block of scan 'older'"),
        (block(100, value=np.nan), "sample 100, x: nan is not a finite number"),
    ],
)
def test_a_wrong_block_stops_the_scan(
    recorded: Callable[..., ScanRecorder], tmp_path: Path, second: ros.Message, named: str
) -> None:
    recorder = recorded([block(0), second])
    assert (recorder.state, recorder.status) == ("failed", 3)
    assert recorder.reason.startswith("desired_displacement: ")
    assert named in recorder.reason
    assert (tmp_path / "bag/metadata.yaml").is_file()


@pytest.mark.parametrize(
    ("kind", "of"),
    [
        (DESIRED.kind, ""),
        (DRIVE.kind, ", of afm_scan_ros/msg/DisplacementBlock and afm_scan_ros/msg/VoltageBlock"),
        (ros.Image, ", of afm_scan_ros/msg/DisplacementBlock and sensor_msgs/msg/Image"),
    ],
)
def test_a_second_publisher_stops_the_scan(
    recorded: Callable[..., ScanRecorder],
    monkeypatch: pytest.MonkeyPatch,
    kind: type[ros.Message],
    of: str,
) -> None:
    monkeypatch.setattr(scan_node, "AFTERLIFE", 0.5)  # it is none that was killed
    recorder = recorded([], kind)
    assert recorder.status == 3
    assert recorder.reason == f"/desired_displacement has 2 publishers{of}: stop all but one"


def broken(*_: object) -> None:
    raise KeyError("injected")


@pytest.mark.parametrize("method", ["follow", "step", "_hear", "watched"])
def test_an_exception_that_nobody_foresaw_fails_the_node(
    recorded: Callable[..., ScanRecorder],
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
    method: str,
) -> None:
    monkeypatch.setattr(ScanRecorder, method, broken)
    recorder = recorded([block(0)])
    assert (recorder.state, recorder.status) == ("failed", 1)
    assert recorder.reason == "KeyError: 'injected'"
    assert "Traceback" in capfd.readouterr().err


def test_a_node_that_cannot_say_so_ends_all_the_same(
    recorded: Callable[..., ScanRecorder],
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(ScanRecorder, "report", broken)
    recorder = recorded([block(0)])
    assert (recorder.state, recorder.status) == ("failed", 1)
    assert "KeyError: 'injected'" in capfd.readouterr().err
