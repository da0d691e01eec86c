"""Parameter files of nodes, read by the nodes themselves."""

import math
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path

import rclpy

from afm_scan_bench.faults.injection.outcome import LossError
from afm_scan_bench.faults.injection.readings import refuse_other, written
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.nodes.declare import undeclared
from afm_scan_ros.nodes.run import join
from afm_scan_ros.nodes.scan_node import ScanNode

UNKNOWN_PARAMETER = "started, with a warning of what it does not know"
ANSWERED = "answered as they read"
IGNORED = "left alone, being for another node"


def read_parameters(path: Path) -> str:
    """Start the node that a file is for, and hold its parameters against the file."""
    name = {"scan": "trajectory_generator"}.get(path.stem, path.stem)
    bag = path.with_name("bag")
    arguments = ["--ros-args", "--params-file", str(path), "-p", f"bag:={bag}"]
    with _joined(name, arguments, path) as node:
        content = written(path)
        if not content:  # an empty file sets nothing
            return IGNORED
        ((section, body),) = content.items()
        if section != f"/**/{name}":
            return IGNORED
        unknown = set(undeclared(node)) - {"bag"}
        known = {k: v for k, v in body["ros__parameters"].items() if k not in unknown}
        values = {each: node.get_parameter(each).value for each in known}
        refuse_other(known, values)
        if any(isinstance(value, float) and not math.isfinite(value) for value in values.values()):
            raise LossError(f"{name} takes what is no finite number")
        return UNKNOWN_PARAMETER if unknown else ANSWERED


@contextmanager
def _joined(name: str, arguments: list[str], path: Path) -> Iterator[ScanNode]:
    try:
        join([name, *arguments])
        node = _kind(name)()
        try:
            yield node
        finally:
            node.destroy_node()
    except InputError as error:  # of one parameter, whose file rclpy cannot name either
        raise InputError(f"{path}: {error}") from error
    finally:
        rclpy.try_shutdown()


def _kind(name: str) -> type[ScanNode]:
    module = import_module(f"afm_scan_ros.nodes.{name}")
    return next(
        value
        for value in vars(module).values()
        if isinstance(value, type) and issubclass(value, ScanNode) and "NAME" in vars(value)
    )
