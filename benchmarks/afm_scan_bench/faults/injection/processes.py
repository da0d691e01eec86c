"""Nodes as processes forked from one that has imported them: scans by the hundred start in time."""

import json
import multiprocessing
import os
import resource
import subprocess
import sys
from collections.abc import Mapping
from contextlib import suppress
from importlib import import_module
from multiprocessing.context import ForkServerProcess
from pathlib import Path

from attrs import frozen

from afm_scan_ros.nodes import NODES as MODULES

NODES = (
    "trajectory_generator",
    "inversion_compensator",
    "piezoscanner_sim",
    "tracking_monitor",
    "scan_recorder",
)

INCOMPLETE = 3
"""Exit status of a node whose scan did not reach its end."""

NO_LIMIT = resource.RLIM_INFINITY

FORKING = multiprocessing.get_context("forkserver")
FORKING.set_forkserver_preload([f"afm_scan_ros.nodes.{MODULES[name]}" for name in NODES])


@frozen(eq=False)
class Forked:
    """A node that runs as a process of its own; what it writes lies in ``output``."""

    name: str
    process: ForkServerProcess
    output: Path

    @classmethod
    def start(
        cls,
        kind: str,
        parameters: Mapping[str, object],
        output: Path,
        room: int = NO_LIMIT,
        name: str = "",
    ) -> "Forked":
        """Start a node in this process's environment, as ``ros2 run`` with ``-p`` would.

        No file that it writes may become larger than ``room`` bytes.
        """
        pairs = [f"{name}:={json.dumps(value)}" for name, value in parameters.items()]
        remap = ["-r", f"__node:={name or kind}"]
        arguments = [
            kind,
            "--ros-args",
            *remap,
            *(argument for pair in pairs for argument in ("-p", pair)),
        ]
        given = dict(os.environ), arguments, output, room
        process = FORKING.Process(target=_live, args=given, daemon=True)
        process.start()
        return cls(name or kind, process, output)

    @property
    def status(self) -> int | None:
        """How it ended: 0, 2 or 3, negative for a signal; None while it runs."""
        return self.process.exitcode

    @property
    def message(self) -> str:
        """All that it wrote."""
        return self.output.read_text("utf-8")

    def send(self, number: int) -> None:
        """Send it a signal, unless it has ended by then."""
        if self.process.pid is not None:
            with suppress(ProcessLookupError):
                os.kill(self.process.pid, number)


def system(*arguments: str) -> None:
    """Run a command of the system, as root; raises CalledProcessError where it fails."""
    subprocess.run(arguments, check=True)  # noqa: S603 - our own words


def _live(environment: dict[str, str], arguments: list[str], output: Path, room: int) -> None:
    os.environ.update(environment)
    resource.setrlimit(resource.RLIMIT_FSIZE, (room, resource.getrlimit(resource.RLIMIT_FSIZE)[1]))
    descriptor = os.open(output, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
    for stream in (1, 2):
        os.dup2(descriptor, stream)
    sys.argv = arguments
    sys.exit(import_module("afm_scan_ros.nodes.run").run_node(arguments[0]))
