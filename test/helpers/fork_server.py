"""Processes of nodes and drivers, forked by ``multiprocessing``'s fork server.

The imports take most of the processor time of a short node, and the tests run hundreds of nodes.
The server has imported what they import. A node's driver is forked from the node, before the node
has threads.
"""

import fcntl
import json
import multiprocessing
import os
import socket
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from multiprocessing.context import ForkProcess, ForkServerProcess
from multiprocessing.process import BaseProcess
from multiprocessing.reduction import DupFd
from pathlib import Path
from types import SimpleNamespace
from typing import IO, Any, Self
from unittest import mock

from attrs import frozen

from afm_scan_ros.drivers import client
from afm_scan_ros.ros import try_shutdown

multiprocessing.get_context("forkserver").set_forkserver_preload(["helpers.node_imports"])
HAVE_DRIVERS = ("start('piezoscanner_sim'))", "start('scanner_driver'))")
HIGH = 512
"""Number above those of all open files."""
REQUEST = 4096
"""Bytes of a driver's command line at most."""


class ForkedProcess(BaseProcess):
    """A process that also has what the product uses of a ``subprocess.Popen``."""

    stdin: IO[bytes] | None = None

    @property
    def returncode(self) -> int | None:
        """Return the status, that of a signal negative, or None while the process runs."""
        return self.exitcode

    def poll(self) -> int | None:
        """Return the same."""
        return self.exitcode

    def wait(self, timeout: float | None = None) -> int:
        """Return the status once there is one. Raises TimeoutExpired."""
        self.join(timeout)
        if self.exitcode is None:
            raise subprocess.TimeoutExpired(self.name, timeout or 0.0)
        return self.exitcode

    def send_signal(self, number: int) -> None:
        """Send a signal, unless the process has ended."""
        if self.exitcode is None:
            os.kill(self.ident or 0, number)

    def communicate(self) -> None:
        """Close the standard input, and wait."""
        if self.stdin is not None:
            self.stdin.close()
        self.wait()

    def __enter__(self) -> Self:
        """Return this process, for which the block's end waits."""
        return self

    def __exit__(self, *_: object) -> None:
        """Wait for the end."""
        self.communicate()


class _Node(ForkedProcess, ForkServerProcess):
    """One that the server forks."""


class _Driver(ForkedProcess, ForkProcess):
    """One that a node forks."""


@frozen
class _Sent:
    """A file that a process receives by its own number."""

    number: int

    def __reduce__(self) -> tuple[Callable[[Any], int], tuple[Any]]:
        return _received, (DupFd(self.number),)


def _received(file: Any) -> int:  # noqa: ANN401 - multiprocessing's own
    return int(file.detach())


def forking(start: Callable[..., ForkedProcess]) -> SimpleNamespace:
    """Return what stands for the module ``subprocess``."""
    return SimpleNamespace(**{**vars(subprocess), "Popen": start})


def fork(
    args: Sequence[str],
    *,
    stdin: int,
    stdout: IO[str] | None = None,
    stderr: IO[str] | None = None,
    pass_fds: Sequence[int] = (),
    **_: bool,
) -> ForkedProcess:
    """Start a process of ``python -c`` in a session of its own, with Popen's arguments."""
    standard = (stdout.fileno() if stdout else 1, stderr.fileno() if stderr else 2)
    theirs, ours = os.pipe()
    files = {0: theirs, 1: standard[0], 2: standard[1], **{each: each for each in pass_fds}}
    sent = {number: _Sent(file) for number, file in files.items()}
    process = _Node(target=_run, args=(_after_c(args), Path.cwd(), dict(os.environ), sent))
    with mock.patch.dict(os.environ, PYTHONPATH=os.pathsep.join(sys.path)):
        process.start()  # the first starts the server, which finds there what it imports
    os.close(theirs)
    process.stdin = os.fdopen(ours, "wb")
    if stdin != subprocess.PIPE:
        process.stdin.close()
    return process


def _after_c(args: Sequence[str]) -> Sequence[str]:
    """Return the code of ``python -c``, whatever options are before it, and its arguments."""
    return args[args.index("-c") + 1 :]


def _run(
    words: Sequence[str], folder: Path, environment: Mapping[str, str], files: Mapping[int, int]
) -> None:
    """Be the process that was asked for."""
    os.setsid()
    _place(files)
    os.environ.clear()
    os.environ.update(environment)
    sys.path[:0] = filter(None, environment.get("PYTHONPATH", "").split(os.pathsep))
    os.chdir(folder)
    code, *sys.argv[1:] = words
    sys.argv[0] = "-c"
    if code.endswith(HAVE_DRIVERS):
        _fork_driver()
    try:
        exec(code, {"__name__": "__main__"})  # noqa: S102 - our own code
    finally:
        try_shutdown()  # as at the interpreter's exit


def _place(files: Mapping[int, int]) -> None:
    """Give each file its number, which another may have."""
    high = {number: fcntl.fcntl(file, fcntl.F_DUPFD, HIGH) for number, file in files.items()}
    for file in files.values():
        os.close(file)
    for number, file in high.items():
        os.dup2(file, number)
        os.close(file)


def _fork_driver() -> None:
    """Fork the node's driver, which waits for its command line; any other is a ``Popen``."""
    ours, theirs = socket.socketpair()

    def start(args: Sequence[str], *, pass_fds: Sequence[int], **_: object) -> ForkedProcess:
        client.subprocess = subprocess  # type: ignore[attr-defined]
        with ours:
            socket.send_fds(ours, [json.dumps([*_after_c(args), *pass_fds]).encode()], pass_fds)
        return process

    process = _Driver(target=_await_request, args=(theirs, ours), daemon=True)
    process.start()
    theirs.close()
    client.subprocess = forking(start)  # type: ignore[attr-defined]


def _await_request(theirs: socket.socket, ours: socket.socket) -> None:
    """Run the driver that is asked for, unless the node ends without."""
    ours.close()
    asked, files, *_ = socket.recv_fds(theirs, REQUEST, 1)
    theirs.close()
    if asked:
        *words, number = json.loads(asked)
        _run(words, Path.cwd(), dict(os.environ), {number: files[0]})
