"""A process that has imported what nodes import, and makes each node by a fork.

The imports take most of the processor time of a short node, and the tests run hundreds of nodes.
A forked node is a process of its own in all else, and a child of the tests' process. So is the
driver's process of a node: the node's child.
"""

import atexit
import ctypes
import fcntl
import gc
import json
import os
import socket
import subprocess
import sys
import threading
import traceback
from collections.abc import Sequence
from functools import cache
from importlib import import_module
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any, NoReturn

IMPORTED = (
    *("numba", "scipy.interpolate", "scipy.linalg", "scipy.signal", "scipy.special"),
    *("afm_scan_ros.drivers.process", "afm_scan_ros.simulation.scanner"),
    *("afm_scan_ros.nodes.excitation_generator", "afm_scan_ros.nodes.inversion_compensator"),
    *("afm_scan_ros.nodes.piezoscanner_sim", "afm_scan_ros.nodes.residual_monitor"),
    *("afm_scan_ros.nodes.scan_imager", "afm_scan_ros.nodes.scan_recorder"),
    *("afm_scan_ros.nodes.scanner_driver", "afm_scan_ros.nodes.tracking_monitor"),
    "afm_scan_ros.nodes.trajectory_generator",
)
DESCRIBED = ("afm_scan_ros", "diagnostic", "lifecycle", "rcl_interfaces", "rmw_dds_common")
"""How packages of messages begin whose types are described to DDS."""
HAVE_DRIVERS = ("start('piezoscanner_sim')", "start('scanner_driver')")
REQUEST, FILES = 2**17, 8
"""Bytes of a request at most, its environment above all; files that it hands over at most."""
HIGH = 512
"""Number above those of all open files."""
BECOME_REAPER = 36
"""PR_SET_CHILD_SUBREAPER of prctl(2): whose parent has ended becomes a child of this process."""


class ForkedProcess(subprocess.Popen[Any]):
    """A process of ``python -c`` in a session of its own."""

    def _execute_child(self, args: list[str], *given: Any) -> None:  # noqa: ANN401 - Popen's
        passed, pipes = given[3], given[9:15]
        streams = enumerate((pipes[0], pipes[3], pipes[5]))
        files = {number: own for number, own in streams if own != -1}
        files |= {number: number for number in passed}
        request = {
            "words": args[2:],
            "folder": str(Path.cwd()),
            "environment": dict(os.environ),
            "files": list(files),
        }
        self.pid = self._ask(json.dumps(request).encode(), list(files.values()))
        self._child_created = True
        self._close_pipe_fds(*pipes)

    def _ask(self, request: bytes, files: Sequence[int]) -> int:
        """Return the number of the process that does what is asked for."""
        server = _server(os.environ.get("PYTHONPATH", ""))
        _adopt_orphans(wanted=True)
        socket.send_fds(server, [request], files)
        number = int(server.recv(REQUEST))
        server.recv(REQUEST)  # by now it is a child of this process
        _adopt_orphans(wanted=False)  # nobody would reap others, and they would seem to run
        return number


def _adopt_orphans(*, wanted: bool) -> None:
    """Let processes whose parent has ended become children of this one, or of init again."""
    assert not ctypes.CDLL(None).prctl(BECOME_REAPER, int(wanted), 0, 0, 0)


def forking(kind: type[ForkedProcess]) -> SimpleNamespace:
    """Return what stands for the module ``subprocess``."""
    return SimpleNamespace(**{**vars(subprocess), "Popen": kind})


@cache
def _server(path: str) -> socket.socket:
    """Start a server with PYTHONPATH as it is, which tests change; it ends with this process."""
    assert path == os.environ.get("PYTHONPATH", "")
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    with theirs:
        number = theirs.fileno()
        words = [sys.executable, __file__, str(number)]
        subprocess.Popen(words, pass_fds=[number], start_new_session=True)
    return ours


def _received(connection: socket.socket) -> tuple[dict[str, Any], list[int]]:
    """Return the next request and its files; end this process when nobody can ask any more."""
    asked, files, *_ = socket.recv_fds(connection, REQUEST, FILES)
    if not asked:
        os._exit(0)
    return json.loads(asked), files


def _serve(connection: socket.socket) -> tuple[dict[str, Any], list[int]]:
    """Fork a process at each request, in which this returns what is asked of it."""
    while True:
        request, files = _received(connection)
        if not (between := os.fork()):
            if not (node := os.fork()):
                return request, files
            connection.send(str(node).encode())
            os._exit(0)
        for file in files:
            os.close(file)
        os.waitpid(between, 0)
        connection.send(b"a child of the tests'")


def _run(connection: socket.socket, request: dict[str, Any], files: list[int]) -> NoReturn:
    """Become the process that is asked for."""
    connection.close()
    os.setsid()
    high = [fcntl.fcntl(file, fcntl.F_DUPFD, HIGH) for file in files]
    for file in files:
        os.close(file)
    for file, number in zip(high, request["files"], strict=True):
        os.dup2(file, number)
        os.close(file)
    os.environ.clear()
    os.environ.update(request["environment"])
    os.chdir(request["folder"])
    code, *sys.argv[1:] = request["words"]
    sys.argv[0] = "-c"
    if code.endswith(tuple(f"{each})" for each in HAVE_DRIVERS)):
        _fork_driver(import_module("afm_scan_ros.drivers.client"))
    os._exit(_status(code))


def _status(code: str) -> int:
    """Run code to its end; no module is taken down, which would copy all that was forked."""
    status = 0
    try:
        exec(code, {"__name__": "__main__"})  # noqa: S102 - our own code
    except SystemExit as end:
        status = int(end.code or 0)
    except BaseException:  # noqa: BLE001 - as the interpreter itself does
        traceback.print_exc()
        status = 1
    threading._shutdown()  # type: ignore[attr-defined]  # noqa: SLF001 - as above
    atexit._run_exitfuncs()  # noqa: SLF001 - as above
    sys.stdout.flush()
    sys.stderr.flush()
    return status


def _fork_driver(client: ModuleType) -> None:
    """Fork the driver's process while nothing runs in this one; it waits for its request."""
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    number = os.fork()
    if not number:
        ours.close()
        _run(theirs, *_received(theirs))
    theirs.close()

    class Waiting(ForkedProcess):
        """The one that waits; once it has been asked for, any other is started."""

        def _ask(self, request: bytes, files: Sequence[int]) -> int:
            client.subprocess = subprocess  # type: ignore[attr-defined]
            with ours:
                socket.send_fds(ours, [request], files)
            return number

    client.subprocess = forking(Waiting)  # type: ignore[attr-defined]


def _describe_types() -> None:
    """Describe the messages to DDS, which takes as long as a short node works."""
    wire = import_module("afm_scan_ros.ros.cyclone.wire")
    for name in wire.TYPESTORE.fielddefs:
        if name.startswith(DESCRIBED):
            wire.envelope_class(name).__idl__.fill_type_data()


def main(number: int) -> None:
    """Serve until the tests end; in each forked process run the code that is asked for."""
    sys.path[0] = ""  # as of python -c
    for name in IMPORTED:
        import_module(name)
    _describe_types()
    gc.freeze()  # a collection would copy all that is forked
    connection = socket.socket(fileno=number)
    _run(connection, *_serve(connection))


if __name__ == "__main__":
    main(int(sys.argv[1]))
