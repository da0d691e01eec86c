"""Opens the viewer, or a file in its place, for the scans that are to be shown; its settings."""

import os
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory, TemporaryFile
from typing import TypeAlias

from attrs import frozen

from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.types import setting
from afm_scan_ros.features.view.priority import run_after

WINDOW = "window"
Viewer: TypeAlias = "subprocess.Popen[bytes] | None"
"""The process of a viewer; None where it is another's, or a file."""
FILE_SUFFIX = ".rrd"
LOOPBACK = "127.0.0.1"
PORT_VARIABLE = "AFM_SCAN_VIEW_PORT"
"""Environment variable with the first of the viewer's three ports, by which a scan finds it."""


@frozen
class ViewSettings:
    """Times and amounts of a live view, none of which a scan waits for but ``closing``."""

    queue: float = setting(
        64e6,
        "byte",
        "Blocks that wait for the viewer's process at most; the oldest go first",
        "13 s of three streams at 100 kHz, four times as long as the viewer takes to start",
    )
    queued_news: int = setting(
        10_000, "1", "News and figures of lines that wait at most", "100 lines/s for 100 s"
    )
    refresh: float = setting(
        0.05, "s", "Time between two updates of the viewer", "a tenth of the 0.5 s aimed at"
    )
    image_interval: float = setting(
        0.25, "s", "Least time between two images, and two tables of states", "as of scan_imager"
    )
    pixels: int = setting(256, "1", "Pixels in a line of the image of errors", "as of scan_imager")
    closing: float = setting(
        3.0,
        "s",
        "Longest wait of a scan, when it is over, for a sign that the viewer shows the rest",
        "sixty updates; one that is stopped is left behind",
    )
    finishing: float = setting(
        60.0,
        "s",
        "Longest wait, when it is over, for a viewer that goes on",
        "nothing moves any more; on two cores with ten busy processes it takes half of that",
    )
    giving_up: float = setting(
        2.0,
        "s",
        "Longest try to reach a viewer that is gone",
        "twice closing; data are dropped then",
    )
    opening: float = setting(
        20.0, "s", "Longest wait for the viewer to open", "ten times what it takes on two cores"
    )
    port: int = setting(
        9886,
        "1",
        "First of three ports on the loopback",
        "ten above Rerun's own, so that both can be open",
    )
    niceness: int = setting(
        5,
        "1",
        "Niceness of the viewer and of what feeds it, and of their sessions",
        "a third of a scan's share of a core; at 10 a busy machine leaves nothing for them",
    )


@frozen
class ViewerPorts:
    """Ports on the loopback: for scans, for the browser's data, and for its page."""

    scans: int
    data: int
    page: int

    @property
    def address(self) -> str:
        """Address of the page."""
        return f"http://{LOOPBACK}:{self.page}?url=ws://{LOOPBACK}:{self.data}"

    @property
    def taken(self) -> bool:
        """Whether a viewer waits for scans."""
        with socket.socket() as probe:
            return probe.connect_ex((LOOPBACK, self.scans)) == 0


def ports() -> ViewerPorts:
    """Return the viewer's ports; raises InputError for an environment variable that is none."""
    given, last = os.environ.get(PORT_VARIABLE, str(ViewSettings().port)), 2**16 - 3
    if not given.isdecimal() or not 0 < int(given) <= last:
        raise InputError(f"{PORT_VARIABLE}={given}: give a port from 1 to {last}")
    first = int(given)
    return ViewerPorts(first, first + 1, first + 2)


def refuse_uninstalled(option: str) -> None:
    """Raise InputError where the viewer is not installed."""
    if find_spec("rerun") is None:
        raise InputError(f"{option}: rerun-sdk is not installed: pip install 'afm_scan_ros[view]'")


def refuse(where: str, option: str) -> None:
    """Raise InputError where nothing can be shown: in the ``window``, or in a file."""
    refuse_uninstalled(option)
    if where != WINDOW:
        _refuse_file(Path(where), option)
    elif not ports().taken and not _has_display():
        raise InputError(
            f"{option}: there is no display to open a window on: start 'afm-scan view --serve'"
            f" first, for a browser, or name a file to write, as scan{FILE_SUFFIX}"
        )


def _refuse_file(path: Path, option: str) -> None:
    if path.suffix != FILE_SUFFIX:
        raise InputError(f"{option} {path}: give a file that ends in {FILE_SUFFIX}")
    if path.exists():
        raise InputError(f"{path} exists: give the name of a new file")
    if not path.absolute().parent.is_dir():
        raise InputError(f"{path.parent} does not exist: make the folder, or give another file")


def _has_display() -> bool:
    shown = os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    return bool(shown) or sys.platform in ("darwin", "win32")


def open_window(settings: ViewSettings) -> Viewer:
    """Open the viewer's window, which stays when this process ends; None where one is open."""
    return None if ports().taken else _start([], settings)


@contextmanager
def serving(settings: ViewSettings) -> Iterator["subprocess.Popen[bytes]"]:
    """Serve the viewer to browsers on this machine; ends with the ``with``."""
    at = ports()
    if at.taken:
        raise InputError(
            f"port {at.scans} is in use, perhaps by a viewer that is open: close it, or set"
            f" {PORT_VARIABLE} to the first of three free ports"
        )
    own = ["--serve-web", "--ws-server-port", str(at.data), "--web-viewer-port", str(at.page)]
    process = _start(own, settings)
    try:
        yield process
    finally:
        process.terminate()
        process.wait()


def _start(arguments: list[str], settings: ViewSettings) -> "subprocess.Popen[bytes]":
    """Start the viewer, and wait until it listens; it sends no statistics of use to anybody."""
    program = _program()
    with TemporaryDirectory() as configuration, TemporaryFile() as said:
        environment = {**os.environ, "XDG_CONFIG_HOME": configuration}
        subprocess.run(  # noqa: S603 - the program of the package
            [program, "analytics", "disable"],
            check=True,
            env=environment,
            stdin=subprocess.DEVNULL,
            stdout=said,
            stderr=said,
        )
        own = ["--bind", LOOPBACK, "--port", str(ports().scans), "--hide-welcome-screen"]
        code = run_after(settings.niceness, "os.execv(sys.argv[1], sys.argv[1:])")
        process = subprocess.Popen(  # noqa: S603 - as above
            [sys.executable, "-P", "-c", code, program, *own, *arguments],
            env=environment,
            stdin=subprocess.DEVNULL,
            stdout=said,
            stderr=said,
            start_new_session=True,
        )
        if not _listens(process, settings):
            process.kill()
            said.seek(0)
            lines = said.read().decode(errors="replace").split("\n")
            last = next((line for line in reversed(lines) if line.strip()), "it does not listen")
            raise ScanError(f"the viewer does not open: {last}")
    return process


def _program() -> str:
    """Return the viewer's own program: its script would leave it behind when it is ended."""
    package = find_spec("rerun_cli")
    if package is None or package.origin is None:
        raise InputError("the package rerun_sdk has no viewer: install rerun-sdk again")
    suffix = ".exe" if sys.platform == "win32" else ""
    return str(Path(package.origin).with_name(f"rerun{suffix}"))


def _listens(process: "subprocess.Popen[bytes]", settings: ViewSettings) -> bool:
    deadline = time.monotonic() + settings.opening
    while process.poll() is None and time.monotonic() < deadline:
        if ports().taken:
            return True
        time.sleep(settings.refresh)
    return False
