"""Shows what the nodes of a scan publish: it reads the monitors' topics, best effort; needs ROS."""

import os
import time
from collections.abc import Callable
from functools import partial

import numpy as np
import rclpy
from attrs import define, field
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy

from afm_scan_ros.bag.scan_info import info_from_message
from afm_scan_ros.bag.typestore import WAYS, Message, heights, line_of
from afm_scan_ros.core.streams import ACHIEVED, DESIRED, DRIVE, monitor_step
from afm_scan_ros.core.types import AXES
from afm_scan_ros.features.view.handover import MISSING
from afm_scan_ros.features.view.screen import ERROR, Screen, open_screen
from afm_scan_ros.features.view.viewer import WINDOW, ViewSettings
from afm_scan_ros.nodes import topics
from afm_scan_ros.nodes.middleware import OF_VIEWERS
from afm_scan_ros.nodes.peers import DONE, FAILED, RUNNING
from afm_scan_ros.nodes.run import join

OVER = {DONE, FAILED}
CURVES = {DESIRED: "desired", ACHIEVED: "achieved", ERROR: "error", DRIVE: "drive"}


def listen(where: str, settings: ViewSettings, wanted: Callable[[], bool]) -> None:
    """Show scan after scan as long as it is ``wanted``; in a file, the first alone."""
    join([], OF_VIEWERS)
    try:
        node, executor = Node(f"afm_scan_view_{os.getpid()}"), SingleThreadedExecutor()
        shown = ShownNodes(where, settings)
        _subscribe(node, shown)
        executor.add_node(node)
        while wanted() and not shown.is_written:
            _hear(executor, settings.refresh)
            shown.refresh()
        _hear_the_rest(executor, shown, settings)
        shown.refresh(last=True)
        executor.shutdown()
    finally:
        rclpy.try_shutdown()


def _hear(executor: SingleThreadedExecutor, longest: float) -> None:
    deadline = time.monotonic() + longest
    while (left := deadline - time.monotonic()) > 0.0:
        executor.spin_once(timeout_sec=left)


def _hear_the_rest(
    executor: SingleThreadedExecutor, shown: "ShownNodes", settings: ViewSettings
) -> None:
    """Hear what has come but was not read, until a look finds nothing more."""
    deadline, before = time.monotonic() + settings.closing, -1
    while shown.heard != before and time.monotonic() < deadline:
        before = shown.heard
        _hear(executor, settings.refresh)


def _subscribe(node: Node, shown: "ShownNodes") -> None:
    """Read the announcement reliably, of which there is one, and all else best effort."""
    hearing = {
        topics.MONITOR: shown.sample,
        topics.NODE_STATE: shown.state,
        topics.TRACKING_ERROR: partial(shown.line, topics.TRACKING_ERROR.name),
        topics.MODEL_RESIDUAL: partial(shown.line, topics.MODEL_RESIDUAL.name),
        topics.TRACE_IMAGE: partial(shown.image, WAYS[topics.TRACE_IMAGE.name]),
        topics.RETRACE_IMAGE: partial(shown.image, WAYS[topics.RETRACE_IMAGE.name]),
    }
    announced = topics.SCAN_INFO
    node.create_subscription(announced.kind, announced.name, shown.meet, announced.reader)
    for topic, hear in hearing.items():
        depth = max(topic.writer.depth, topic.reader.depth)
        quality = QoSProfile(depth=depth, reliability=ReliabilityPolicy.BEST_EFFORT)
        node.create_subscription(topic.kind, topic.name, hear, quality)


@define(eq=False)
class ShownNodes:
    """The scan that nodes announced last."""

    _where: str
    _settings: ViewSettings
    _screen: Screen | None = field(default=None, init=False)
    heard: int = field(default=0, init=False)
    _samples: list[Message] = field(factory=list, init=False)
    _next: int | None = field(default=None, init=False)
    _reasons: dict[str, str] = field(factory=dict, init=False)
    _states: dict[str, Message] = field(factory=dict, init=False)

    @property
    def is_written(self) -> bool:
        """Whether the scan that goes to a file is over."""
        if self._screen is None or self._where == WINDOW:
            return False
        scan = self._screen.info.scan_id
        states = [each.state for each in self._states.values() if each.scan_id == scan]
        return bool(states) and set(states) <= OVER

    def meet(self, message: Message) -> None:
        """Begin to show a scan."""
        if self._screen is not None and self._where != WINDOW:
            return
        self.refresh(last=True)
        self._samples.clear()
        self._screen = open_screen(info_from_message(message), self._where, self._settings)
        self._next = None
        for state in [*self._states.values()]:
            self.state(state)

    def sample(self, message: Message) -> None:
        """Take one sample of all curves."""
        self.heard += 1
        self._samples.append(message)

    def line(self, name: str, message: Message) -> None:
        """Show the figures of a line."""
        self.heard += 1
        if self._screen is not None:
            self._screen.line(name, line_of(self._screen.info, message))

    def image(self, name: str, message: Message) -> None:
        """Show an image as far as it has grown."""
        if self._screen is not None:
            self._screen.image(name, heights(message))

    def state(self, message: Message) -> None:
        """Show the state of a node, and its reason as news where that changes."""
        self._states[message.node] = message
        if self._screen is None or message.scan_id not in ("", self._screen.info.scan_id):
            return
        self._screen.state(message.node, message.state, message.next_sample, message.reason)
        if message.reason != self._reasons.get(message.node, ""):
            self._reasons[message.node] = message.reason
            if message.reason and message.state in (RUNNING, FAILED):
                self._screen.say(f"{message.node}: {message.reason}", message.next_sample)

    def refresh(self, *, last: bool = False) -> None:
        """Show what came since the last time."""
        if self._screen is None:
            return
        if self._samples:
            self._show_samples(self._screen)
        self._screen.refresh(last=last)

    def _show_samples(self, screen: Screen) -> None:
        samples = [each for each in self._samples if each.scan_id == screen.info.scan_id]
        self._samples.clear()
        if not samples:
            return
        numbers = np.array([each.sample for each in samples])
        for name, prefix in CURVES.items():
            x, y = (np.array([getattr(s, f"{prefix}_{axis}") for s in samples]) for axis in AXES)
            screen.curve(name, numbers, x, y)
        step = monitor_step(screen.info.sample_period)
        first = numbers[0] if self._next is None else self._next
        if lost := int(numbers[-1] - first) // step + 1 - numbers.size:
            screen.say(f"{lost} samples are {MISSING}", int(numbers[-1]))
        self._next = int(numbers[-1]) + step
