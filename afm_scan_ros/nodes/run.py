"""Runs one node as a process: its loop, its signals and its exit status.

A node started by another process ends when that process has ended.
"""

import os
import signal
import sys
import threading
import traceback
from collections.abc import Iterator
from contextlib import contextmanager

from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.nodes.scan_node import ScanNode
from afm_scan_ros.ros import (
    SignalHandlerOptions,
    SingleThreadedExecutor,
    init,
    try_shutdown,
    undeclared_parameters,
    use_node_settings,
    users_settings,
)

_INPUT = 0


def end_with_parent() -> None:
    """End this process, as SIGTERM does, when the pipe on its standard input closes.

    The parent holds the other end and writes nothing, so it closes with the parent alone.
    """
    threading.Thread(target=_await_end, daemon=True).start()


def _await_end() -> None:
    """Read past sys.stdin, whose lock a thread would still hold when the interpreter ends."""
    while os.read(_INPUT, 1):
        pass
    os.kill(os.getpid(), signal.SIGTERM)


IDLE = 0.01
"""Longest wait, s, for a message before a node looks after itself."""


def run_node(kind: type[ScanNode]) -> int:
    """Run a node until it ends; return its status.

    0 is done, 2 bad input, 3 what was asked does not hold, 1 a fault of the program.
    """
    with _signals() as caught:
        try:
            _join()
            node = kind()
            warn_of_undeclared(node)
            _warn_of_watermarks(node)
        except InputError as error:
            return _ended(kind.NAME, str(error), 2)
        else:
            return _run(node, caught)
        finally:
            try_shutdown()


def warn_of_undeclared(node: ScanNode) -> None:
    """Log the parameters that were given and that the node does not have."""
    for name in undeclared_parameters(node):
        node.get_logger().warning(f"parameter {name} does nothing: {node.NAME} has none")


def _warn_of_watermarks(node: ScanNode) -> None:
    if "Watermarks" in users_settings():
        node.get_logger().warning(
            "CYCLONEDDS_URI sets Watermarks, which replace those of this package: a viewer that is"
            " stopped or killed may block a node and end the scan; remove them"
        )


def _join() -> None:
    use_node_settings()
    try:
        init(signal_handler_options=SignalHandlerOptions.NO)
    except RuntimeError as error:  # rclpy's, for arguments that do not parse
        raise InputError(str(error)) from error


def _run(node: ScanNode, caught: list[str]) -> int:
    name = node.get_name()  # rclpy forgets it with the node
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    try:
        live(node, executor, caught)
    finally:
        executor.shutdown()
        node.destroy_node()
    return _ended(name, node.reason, node.status)


def live(node: ScanNode, executor: SingleThreadedExecutor, caught: list[str]) -> None:
    """Let a node live until it ends; ``caught`` are the names of signals that came."""
    busy = False
    node.hear_others()
    while not node.finished:
        try:
            executor.spin_once(timeout_sec=0.0 if busy else IDLE)
            busy = node.tick()
            if caught:
                node.interrupt(caught.pop())
        except Exception as error:  # noqa: BLE001 - whatever it is, the others are told
            _fail(node, error)


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


@contextmanager
def _signals() -> Iterator[list[str]]:
    """Collect SIGINT and SIGTERM by name, also where a background shell had SIGINT ignored.

    rclpy's own handlers would end the context, and with it what a node has still to say.
    """
    caught: list[str] = []
    taken = (signal.SIGINT, signal.SIGTERM)
    before = [
        signal.signal(number, lambda n, _: caught.append(signal.Signals(n).name))
        for number in taken
    ]
    try:
        yield caught
    finally:
        for number, handler in zip(taken, before, strict=True):
            signal.signal(number, handler)
