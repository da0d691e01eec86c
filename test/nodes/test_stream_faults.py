"""What goes wrong on a topic stops the scan, with an error that names it."""

from collections.abc import Callable, Iterator
from pathlib import Path
from threading import Event, Thread

import numpy as np
import pytest
from attrs import evolve
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from afm_scan_ros.bag.scan_info import encode_block
from afm_scan_ros.core.scan_info import ScanInfo
from afm_scan_ros.core.types import Trace
from afm_scan_ros.nodes.messages import Message, info_message, state_message
from afm_scan_ros.nodes.run import live
from afm_scan_ros.nodes.scan_recorder import ScanRecorder
from afm_scan_ros.nodes.topics import DESIRED, NODE_STATE, SCAN_INFO
from helpers.ros import joined, publisher

INFO = ScanInfo(
    "tested", 10**18, "creep", 1e-4, 4000, window=4000, nodes=("source", "scan_recorder")
)
Messages = Callable[[], list[Message]]


def block(first: int, info: ScanInfo = INFO, value: float = 0.0) -> bytes:
    samples = np.full(100, value)
    return encode_block(
        DESIRED.type_name, info, Trace(first, info.sample_period, samples, samples), last=False
    )


class Source(Node):
    """Announces a scan, and sends its messages once the recorder is ready, by turns."""

    def __init__(self, messages: list[Message]) -> None:
        super().__init__("source")
        self._messages = messages
        self._ready = False
        self._state, self._blocks = publisher(self, NODE_STATE), publisher(self, DESIRED)
        self.create_subscription(NODE_STATE.kind, NODE_STATE.name, self._hear, NODE_STATE.reader)
        publisher(self, SCAN_INFO).publish(info_message(INFO))
        self._ended = Event()
        self._acting = Thread(target=self._act)
        self._acting.start()

    def destroy_node(self) -> None:
        self._ended.set()
        self._acting.join()
        super().destroy_node()

    def _hear(self, message: Message) -> None:
        if message.node == "scan_recorder" and message.scan_id == INFO.scan_id:
            self._ready = True

    def _act(self) -> None:
        while not self._ended.wait(0.05):
            self._state.publish(state_message(INFO, "source", "running", 0, ""))
            if self._ready and self._messages:
                self._blocks.publish(self._messages.pop(0))


@pytest.fixture
def recorded(tmp_path: Path) -> Iterator[Callable[..., ScanRecorder]]:
    """Return a function that lets a recorder follow a source until it ends."""

    def follow(messages: list[Message]) -> ScanRecorder:
        recorder, source = ScanRecorder(), Source(messages)
        executor = SingleThreadedExecutor()
        executor.add_node(source)
        executor.add_node(recorder)
        live(recorder, executor, [])
        executor.shutdown()
        source.destroy_node()
        recorder.destroy_node()
        return recorder

    with joined(bag=str(tmp_path / "bag"), topics=[DESIRED.name]):
        yield follow


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
    recorded: Callable[..., ScanRecorder], tmp_path: Path, second: Message, named: str
) -> None:
    recorder = recorded([block(0), second])
    assert (recorder.state, recorder.status) == ("failed", 3)
    assert recorder.reason.startswith("desired_displacement: ")
    assert named in recorder.reason
    assert (tmp_path / "bag/metadata.yaml").is_file()


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


@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
def test_a_node_that_cannot_say_so_ends_all_the_same(
    recorded: Callable[..., ScanRecorder],
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(ScanRecorder, "report", broken)
    recorder = recorded([block(0)])
    assert (recorder.state, recorder.status) == ("failed", 1)
    assert "KeyError: 'injected'" in capfd.readouterr().err
