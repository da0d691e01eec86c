"""Runs the nodes of a scan, each as a process, and reports which failed and why.

They communicate in a DDS domain of their own, on this machine alone.
"""

import json
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import IO

from attrs import field, frozen

from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.nodes.parameters import STOPPED
from afm_scan_ros.pipeline import TRACEBACK, handling

_FIRST, _COUNT = 1, 101  # ROS 2's domains whose ports no system hands out otherwise


_OURS = "AFM_SCAN_DOMAIN_ID"
"""Variable that distinguishes a domain chosen here from the user's."""


def isolate() -> None:
    """Set ROS_DOMAIN_ID to a domain that nobody uses, and keep it on loopback.

    Does nothing where the user has set one; one chosen for an earlier scan may be another's by
    now, and is chosen anew. Raises ScanError if all are in use.
    """
    given = os.environ.get("ROS_DOMAIN_ID")
    if given is not None and given != os.environ.get(_OURS):
        return
    start = os.getpid()
    for offset in range(_COUNT):
        domain = _FIRST + (start + offset) % _COUNT
        if _is_free(domain):
            os.environ["ROS_DOMAIN_ID"] = os.environ[_OURS] = str(domain)
            os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
            return
    raise ScanError("all DDS domains are in use: set ROS_DOMAIN_ID to a free one")


def _is_free(domain: int) -> bool:
    """Return whether the port of a domain's first participant is free (DDSI-RTPS 2.2, 9.6.1)."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.bind(("127.0.0.1", 7410 + 250 * domain))
        except OSError:
            return False
    return True


PATIENCE = 3.0
"""Silence of a node, s, after which a simulated scan is given up: only minutes are at stake."""
GRACE = 5.0
"""Seconds that the other nodes have to end by themselves once one has ended badly."""

_START = (
    "import sys; from afm_scan_ros.nodes import end_with_parent, start; end_with_parent();"
    " sys.exit(start('{}'))"
)


LOG = "traceback.log"
"""File in a bag's folder."""
_LOGGED = re.compile(r"^(\[[^]]*\] ){2}\[[^]]*\]: ")
"""What stands before the text of a log line."""
_WARNED = re.compile(r"^\[WARN\] \[[^]]*\] \[[^]]*\]: (.*)$", re.MULTILINE)


@frozen
class Ended:
    """How a node ended: 0, 2 bad input, 3 what was asked does not hold, negative for a signal.

    ``traceback`` is its output where that holds the traceback of an unforeseen error, ``warnings``
    are those that it logged.
    """

    name: str
    status: int
    said: str
    traceback: str = ""
    warnings: tuple[str, ...] = ()


@frozen
class NodeCommand:
    """A node to run, with parameters of a file and, before these, its own."""

    name: str
    parameters: Mapping[str, object] = field(factory=dict)
    params_file: Path | None = None

    def arguments(self) -> list[str]:
        """Return the command line; a JSON value means the same in YAML, to rcl too."""
        file = ["--params-file", str(self.params_file)] if self.params_file else []
        pairs = [f"{name}:={json.dumps(value)}" for name, value in self.parameters.items()]
        own = [word for pair in pairs for word in ("-p", pair)]
        return [sys.executable, "-P", "-c", _START.format(self.name), "--ros-args", *file, *own]


@frozen(eq=False)
class NodeProcess:
    """A running node, with its output."""

    name: str
    process: "subprocess.Popen[str]"
    output: IO[str]

    @classmethod
    def start(cls, command: NodeCommand) -> "NodeProcess":
        """Start a node; SIGINT reaches it by its parent alone, and it ends when that is gone."""
        output = tempfile.TemporaryFile("w+", encoding="utf-8")  # noqa: SIM115 - closed by the caller
        process = subprocess.Popen(  # noqa: S603 - our own interpreter and modules
            command.arguments(),
            stdin=subprocess.PIPE,
            stdout=output,
            stderr=output,
            text=True,
            start_new_session=True,
        )
        return cls(command.name, process, output)

    def ended(self) -> Ended:
        """Return how it ended."""
        written = self._written()
        traceback = written if TRACEBACK in written else ""
        warnings = tuple(_WARNED.findall(written))
        return Ended(self.name, self.process.returncode, self.last_words(), traceback, warnings)

    def last_words(self) -> str:
        """Return its last line of output, or the signal that killed it.

        What it says by name counts more than what the system says of a crash thereafter.
        """
        status, begun = self.process.returncode, f"{self.name}: "
        written = reversed(self._written().split("\n"))
        lines = [_LOGGED.sub("", line) for line in written if line.strip()]
        own = [line for line in lines if line.startswith(begun)]
        if own:
            return own[0]
        if status < 0:
            return f"{begun}killed by {signal.Signals(-status).name}"
        return begun + (lines[0] if lines else "")

    def _written(self) -> str:
        self.output.seek(0)
        return self.output.read()


@contextmanager
def setting_aside(bags: Iterable[Path]) -> Iterator[None]:
    """Rename the bags of a run that fails within to NAME.failed, so that it can be tried again.

    An earlier NAME.failed is replaced. The last of them also gets the tracebacks that an error has
    as notes. Raises what was raised, whose text then says where all this is.
    """
    try:
        yield
    except (InputError, ScanError) as error:
        raise type(error)(f"{error}{_set_aside(bags, error)}") from error
    except KeyboardInterrupt as error:
        raise KeyboardInterrupt(f"interrupted{_set_aside(bags, error)}") from error


def _set_aside(bags: Iterable[Path], error: BaseException) -> str:
    """Return where the bags and the notes of an error now are, to follow the error's text."""
    kept = []
    for bag in (each for each in bags if each.exists()):
        failed = bag.with_name(f"{bag.name}.failed")
        if failed.exists():
            shutil.rmtree(failed)
        kept.append(bag.rename(failed))
    if not kept:
        return ""
    where = f"; what was recorded is in {', '.join(map(str, kept))}"
    if notes := getattr(error, "__notes__", ()):
        (kept[-1] / LOG).write_text("\n".join(notes), "utf-8")
        where += f", the traceback in {kept[-1] / LOG}"
    return where


def run_nodes(
    commands: Sequence[NodeCommand], idle: Callable[[], None], others: Sequence[str] = ()
) -> list[Ended]:
    """Run nodes until all have ended, calling ``idle``, which takes a moment, meanwhile.

    ``others`` are nodes that may have begun the trouble too, wherever they run.
    Raises InputError or ScanError with the messages of the nodes that failed first.
    """
    names = [*(command.name for command in commands), *others]
    running: list[NodeProcess] = []
    with handling(signal.default_int_handler), ExitStack() as open_ends:
        try:
            for command in commands:
                running.append(NodeProcess.start(command))
                open_ends.enter_context(running[-1].output)
                open_ends.enter_context(running[-1].process)
            _wait(running, idle)
        finally:
            stuck = _end(running)
        ended = [node.ended() for node in running if node not in stuck]
        raise_failure(ended, names)
        raise_failure([node.ended() for node in stuck], names)
        return ended


def _wait(nodes: Sequence[NodeProcess], idle: Callable[[], None]) -> None:
    """Return when all nodes have ended, or when the rest exceed their time."""
    deadline = None
    while any(node.process.poll() is None for node in nodes):
        idle()
        if deadline is None and any(node.process.poll() for node in nodes):
            deadline = time.monotonic() + GRACE
        if deadline is not None and time.monotonic() > deadline:
            return


def _end(nodes: Sequence[NodeProcess]) -> list[NodeProcess]:
    """End the nodes that still run, by force if necessary, and return them."""
    alive = [node for node in nodes if node.process.poll() is None]
    for node in alive:
        node.process.terminate()
    for node in alive:
        try:
            node.process.wait(GRACE)
        except subprocess.TimeoutExpired:
            node.process.kill()
            node.process.wait()
    return alive


def raise_failure(ended: Iterable[Ended], names: Iterable[str]) -> None:
    """Raise the error of the nodes that failed by themselves, not because another did.

    Its notes are their tracebacks, if any. A scan that was stopped on request is incomplete, though
    no node has failed.
    """
    failed = [node for node in ended if node.status or STOPPED in node.said]
    if not failed:
        return
    blame = re.compile(rf"\b({'|'.join(names)}) (failed|has been silent|has finished no sample)")
    named = {match[1] for node in failed if (match := blame.search(node.said))}
    causes = [node for node in failed if not blame.search(node.said)]
    causes = causes or [node for node in failed if node.name in named] or failed[-1:]
    message = "; ".join(node.said for node in causes)
    bad_input = all(node.status == 2 for node in causes)  # noqa: PLR2004 - its status
    error: Exception = InputError(message) if bad_input else ScanError(message)
    for node in causes:
        if node.traceback:
            error.add_note(node.traceback)
    raise error
