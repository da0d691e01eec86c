"""One scan to be disturbed: in a domain of its own, its nodes as processes, their reports heard."""

import time
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from types import TracebackType
from typing import Self

import rclpy
from attrs import frozen
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from afm_scan_bench.faults.faults import Announce
from afm_scan_bench.faults.injection import viewer
from afm_scan_bench.faults.injection.bag import Undisturbed
from afm_scan_bench.faults.injection.processes import NO_LIMIT, NODES, Forked
from afm_scan_ros.cli.processes import isolate
from afm_scan_ros.core.errors import ScanError
from afm_scan_ros.nodes import middleware
from afm_scan_ros.nodes.messages import Message
from afm_scan_ros.nodes.peers import RUNNING
from afm_scan_ros.nodes.topics import NODE_STATE

PATIENCE = 60.0
"""Longest wait, s, for what a trial waits for: a hang, if it takes longer."""
MOMENT = 0.01

CONSUMERS = NODES[1:]
BLOCK = 500
"""Samples."""
SCAN: Mapping[str, object] = {
    "range_x_um": 10.0,
    "range_y_um": 10.0,
    "line_rate_hz": 20.0,
    "lines": 45,
    "samples_per_line": 1000,
    "preparation_cycles": 5,
    "block_size": BLOCK,
    "window": 5000,
}
"""Three seconds of scanning at 20 kHz."""
FLOW: Mapping[str, Mapping[str, object]] = {
    "trajectory_generator": {"required_nodes": list(CONSUMERS), "min_subscriptions": 3, **SCAN},
    "inversion_compensator": {"min_subscriptions": 3},
    "piezoscanner_sim": {"min_subscriptions": 2},
    "tracking_monitor": {"min_subscriptions": 1},
}
PATIENT: Mapping[str, Mapping[str, object]] = {
    **{name: {"liveness_timeout_s": 5.0, "progress_timeout_s": 5.0} for name in NODES},
    "piezoscanner_sim": {
        "liveness_timeout_s": 5.0,
        "progress_timeout_s": 5.0,
        "upstream_timeout_s": 5.0,
    },
}
"""So that what the machine has no time for is not taken for gone."""


@frozen
class Heard:
    """What a node reported of itself, and when (s, steady)."""

    moment: float
    node: str
    state: str
    next_sample: int
    reason: str


class Listener(Node):
    """Keeps every node_state that is heard."""

    def __init__(self) -> None:
        super().__init__("listener")
        self.heard: list[Heard] = []
        self.create_subscription(NODE_STATE.kind, NODE_STATE.name, self._hear, NODE_STATE.reader)

    def _hear(self, message: Message) -> None:
        moment = time.monotonic()
        self.heard.append(
            Heard(moment, message.node, message.state, message.next_sample, message.reason)
        )


class Trial:
    """A scan whose nodes are started one by one; a context manager that leaves none of them."""

    def __init__(self, folder: Path, **parameters: Mapping[str, object]) -> None:
        self.folder = folder
        self.bag = Path(str(parameters.get("scan_recorder", {}).get("bag", folder / "bag")))
        self.nodes: dict[str, Forked] = {}
        self._started: list[Forked] = []
        self._parameters = parameters

    def __enter__(self) -> Self:
        self.folder.mkdir()
        isolate()
        middleware.prepare()
        rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
        self._listener = Listener()
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self._listener)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        for node in self._started:
            node.process.kill()
            node.process.join()
        self._executor.shutdown()
        self._listener.destroy_node()  # which ends its participant
        rclpy.shutdown()

    @property
    def heard(self) -> list[Heard]:
        """All reports so far."""
        return self._listener.heard

    def start(self, *names: str, room: int = NO_LIMIT) -> None:
        """Start nodes, each also a second time; none may write a file of more than ``room`` B."""
        for name in names:
            bag = {"bag": str(self.bag)} if name == "scan_recorder" else {}
            own = {**bag, **FLOW.get(name, {}), **self._parameters.get(name, {})}
            output = self.folder / f"{len(self._started)}_{name}.txt"
            self.nodes[name] = Forked.start(name, own, output, room)
            self._started.append(self.nodes[name])

    def start_another(self, kind: str, name: str) -> Forked:
        """Start one more node of a kind, which has no part in the scan, under its own name."""
        bag = {"bag": str(self.folder / name)} if kind == "scan_recorder" else {}
        output = self.folder / f"{len(self._started)}_{name}.txt"
        self._started.append(Forked.start(kind, bag, output, name=name))
        return self._started[-1]

    def start_viewer(self) -> Forked:
        """Start a viewer, which has no part in the scan."""
        self._started.append(viewer.start(self.folder / "viewer.txt"))
        return self._started[-1]

    def listen(self, seconds: float) -> None:
        """Let time pass."""
        self.until(lambda: False, seconds)

    def until(self, holds: Callable[[], bool], patience: float = PATIENCE) -> bool:
        """Listen until something holds; return whether it does."""
        deadline = time.monotonic() + patience
        while not holds():
            if (left := deadline - time.monotonic()) <= 0.0:
                return False
            self._executor.spin_once(timeout_sec=min(MOMENT, left))
        return True

    def until_running(self) -> bool:
        """Listen until the scanner moves."""
        return self.until(lambda: self.is_running("piezoscanner_sim"))

    def until_ended(self) -> bool:
        """Listen until all nodes have ended."""
        return self.until(lambda: None not in self.statuses().values())

    def is_running(self, name: str) -> bool:
        """Whether a node reported that the scan runs."""
        return any(each.node == name and each.state == RUNNING for each in self.heard)

    def statuses(self) -> dict[str, int | None]:
        """How each node ended."""
        return {name: node.status for name, node in self.nodes.items()}


def numbered(report: Announce, what: str, trials: int, folder: str) -> Iterator[tuple[int, Path]]:
    """Number the trials of a fault, each with a folder to be made, and announce each."""
    for number in range(trials):
        report(f"{what} {number} of {trials}")
        yield number, Path(folder) / f"{what}_{number}"


def undisturbed(folder: Path, scan: Mapping[str, object] = SCAN) -> Undisturbed:
    """Make the scan that nothing disturbs; raises ScanError where it did not end well."""
    quick = {**PATIENT, NODES[0]: {**PATIENT[NODES[0]], **scan, "time_scale": 0.0}}
    with Trial(folder / "undisturbed", **quick) as trial:
        trial.start(*NODES)
        trial.until_ended()
        if set(trial.statuses().values()) != {0}:
            texts = "; ".join(node.message.strip() for node in trial.nodes.values() if node.status)
            raise ScanError(f"the undisturbed scan did not end well: {texts}")
        return Undisturbed(trial.bag)
