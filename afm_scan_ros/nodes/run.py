"""Runs one node as a process: its loop, its signals and its exit status."""

import gc
import os
import signal
import sys
import time
import traceback
from functools import partial
from importlib import import_module
from pathlib import Path

import rclpy
from rclpy.duration import Duration
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.nodes import NODES, middleware
from afm_scan_ros.nodes.declare import undeclared
from afm_scan_ros.nodes.diagnostics import Diagnostics
from afm_scan_ros.nodes.ending import end_within
from afm_scan_ros.nodes.messages import state_message
from afm_scan_ros.nodes.peers import FAILED
from afm_scan_ros.nodes.scan_node import ScanNode
from afm_scan_ros.nodes.topics import NODE_STATE

SIGNALS = (signal.SIGINT, signal.SIGTERM)
NICENESS = -11
"""Of a node in real time: PulseAudio's by default (pulse-daemon.conf, nice-level)."""
AUTOGROUP = Path("/proc/self/autogroup")


def node_class(name: str) -> type[ScanNode]:
    """Import the module of a node, and return its class."""
    module = import_module(f"afm_scan_ros.nodes.{NODES[name]}")
    found: type[ScanNode] = getattr(module, name.title().replace("_", ""))
    return found


def run_node(name: str) -> int:
    """Run the node of a name until it ends; return its status.

    0 is done, 2 bad input, 3 what was asked does not hold, 1 a fault of the program. A signal ends
    the process at once before the node joins ROS, which it does when it has compiled its loops.
    """
    kind = node_class(name)
    kind.warm_up()
    caught = _catch_signals()
    try:
        join()
        return _run(_made(kind), caught)
    except InputError as error:
        return _ended(kind.NAME, str(error), 2)
    finally:
        rclpy.try_shutdown()
        _ignore_signals()


def _made(kind: type[ScanNode]) -> ScanNode:
    """Return a node; raises InputError, said in ROS too, where it cannot be made."""
    try:
        node = kind()
    except InputError as error:
        _report_refusal(kind, error)
        raise
    for name in undeclared(node):
        node.get_logger().warning(f"parameter {name} does nothing: {node.NAME} has none")
    if node.settings["real_time"]:
        _take_priority(node)
    return node


def _take_priority(node: ScanNode) -> None:
    """Let a node that has to keep pace come before usual work, as an audio server does.

    All its threads: those of DDS are there by now. Where Linux schedules sessions first, niceness
    counts only within one, and the commands give each node a session of its own: this gets the
    same niceness. A system may not permit it.
    """
    try:
        for thread in Path("/proc/self/task").iterdir():
            os.setpriority(os.PRIO_PROCESS, int(thread.name), NICENESS)
        if AUTOGROUP.exists() and os.getsid(0) == os.getpid():
            AUTOGROUP.write_text(str(NICENESS), "ascii")
    except OSError as error:
        node.get_logger().info(f"no priority over other work: {error}")


def _report_refusal(kind: type[ScanNode], error: InputError) -> None:
    """Log why a node cannot be made, and publish its state, so that no other waits for it."""
    node, safety = Node(kind.NAME), kind.safety
    publisher = node.create_publisher(NODE_STATE.kind, NODE_STATE.name, NODE_STATE.writer)
    node.get_logger().error(f"{FAILED}: {error}")
    deadline = time.monotonic() + safety.discovery
    while not publisher.get_subscription_count() and time.monotonic() < deadline:
        time.sleep(safety.idle)
    publisher.publish(state_message(None, node.get_name(), FAILED, 0, str(error)))
    Diagnostics(node).publish(FAILED, str(error), dict)
    publisher.wait_for_all_acked(Duration(seconds=safety.discovery))
    time.sleep(safety.last_word)
    node.destroy_node()


def join(arguments: list[str] | None = None, profiles: str = middleware.OF_NODES) -> None:
    """Join ROS with the arguments of a command line, by default this process's.

    What is to be known of the middleware goes to stderr before, since it may be why joining hangs.
    """
    for warning in middleware.prepare(profiles=profiles):
        sys.stderr.write(f"{warning}\n")
    try:
        rclpy.init(args=arguments, signal_handler_options=SignalHandlerOptions.NO)
    except RuntimeError as error:  # for arguments that do not parse
        raise InputError(str(error)) from error


def _run(node: ScanNode, caught: list[str]) -> int:
    name = node.get_name()  # rclpy forgets it with the node
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    gc.collect()
    gc.freeze()  # a full collection of what is loaded takes 80 ms, as long as four blocks
    try:
        live(node, executor, caught)
    finally:
        node.on_closed = partial(_say_end, node, name)
        executor.shutdown()
        node.destroy_node()
    return node.status


def _say_end(node: ScanNode, name: str) -> None:
    """Write how the node ended, and keep its status whatever happens while it leaves ROS."""
    end_within(node.safety.leaving, _ended(name, node.reason, node.status))


def live(node: ScanNode, executor: SingleThreadedExecutor, caught: list[str]) -> None:
    """Let a node live until it ends; ``caught`` are the names of signals that came."""
    busy = False
    node.hear_others()
    while not node.finished:
        try:
            hear(node, executor, 0.0 if busy else node.safety.idle)
            busy = node.tick()
            if caught:
                node.interrupt(caught.pop())
        except Exception as error:  # noqa: BLE001 - whatever it is, the others get the reason
            _fail(node, error)


def hear(node: ScanNode, executor: SingleThreadedExecutor, wait: float) -> None:
    """Call back for all that has arrived, for ``safety.idle`` at most; wait (s) where nothing has.

    The executor serves what is no message: parameters, services and the states of a lifecycle.
    """
    if not node.take_messages(node.safety.idle):
        node.all_heard()
        node.await_message(wait)
    if node.watch_is_due:
        executor.spin_once(timeout_sec=0.0)


def _fail(node: ScanNode, error: Exception) -> None:
    """Fail a node; what nobody foresaw is logged, also where it keeps the node from saying so."""
    if not isinstance(error, InputError | ScanError) and not node.leaving:
        _log(node, error)
    try:
        node.fail(error)
    except Exception as another:  # noqa: BLE001 - as above
        _log(node, another)


def _log(node: ScanNode, error: Exception) -> None:
    node.get_logger().error("".join(traceback.format_exception(error)))


def _ended(name: str, reason: str, status: int) -> int:
    if status:
        sys.stderr.write(f"{name}: {' '.join(reason.split())}\n")
    return status


def _catch_signals() -> list[str]:
    """Collect SIGINT and SIGTERM by name, also where a background shell had SIGINT ignored.

    rclpy's own handlers would end the context, and with it what a node has still to say.
    """
    caught: list[str] = []
    for number in SIGNALS:
        signal.signal(number, lambda number, _: caught.append(signal.Signals(number).name))
    return caught


def _ignore_signals() -> None:
    """Let no signal change the status of a node that has ended while its interpreter ends."""
    for number in SIGNALS:
        signal.signal(number, signal.SIG_IGN)
