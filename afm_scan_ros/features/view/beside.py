"""Opens a view beside a scan: a process of its own, which gets blocks or listens to nodes."""

import os
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from tempfile import TemporaryFile
from typing import IO

import numpy as np
from attrs import asdict, frozen

from afm_scan_ros.bag.live import ScanListener
from afm_scan_ros.bag.scan_info import encode_info
from afm_scan_ros.cli.viewing import ScanView
from afm_scan_ros.core.scan_info import ScanInfo
from afm_scan_ros.core.streams import LineError
from afm_scan_ros.core.types import Trace
from afm_scan_ros.drivers.link import Message
from afm_scan_ros.features.view.handover import (
    BLOCK,
    DOING,
    ENDED,
    LINE,
    NODES,
    PIPELINE,
    SAY,
    SCAN,
    Handover,
)
from afm_scan_ros.features.view.priority import run_after
from afm_scan_ros.features.view.viewer import WINDOW, ViewSettings, refuse

_RUN = "from afm_scan_ros.features.view.process import main; main(*sys.argv[1:])"


@frozen(eq=False)
class Feed:
    """Hears how a scan goes on, and passes it on to another listener and to the viewer."""

    _handover: Handover
    _listener: ScanListener

    def doing(self, what: str) -> None:
        """Hear what is done before the scan begins."""
        self._listener.doing(what)
        self._handover.news(Message(DOING, {"what": what}))

    def moved(self, sample: int, total: int) -> None:
        """Hear how far the scan is; the viewer sees that by its blocks."""
        self._listener.moved(sample, total)

    def say(self, news: str) -> None:
        """Hear what the user should know."""
        self._listener.say(news)
        self._handover.news(Message(SAY, {"text": news}))

    def block(self, name: str, block: Trace) -> None:
        """Take the next block of a stream."""
        where = {"name": name, "first_sample": block.first_sample}
        self._handover.block(Message(BLOCK, where, np.stack([block.x, block.y])))

    def line(self, name: str, figures: LineError) -> None:
        """Take the figures of a line that the viewer does not compute itself."""
        self._handover.news(Message(LINE, {"name": name, "figures": asdict(figures)}))


@contextmanager
def beside_pipeline(
    settings: ViewSettings, where: str, info: ScanInfo, listener: ScanListener
) -> Iterator[Feed]:
    """Show a scan of this process while it runs."""
    with _viewing(PIPELINE, where, settings, listener) as handover:
        handover.news(Message(SCAN, {"info": encode_info(info).hex()}))
        try:
            yield Feed(handover, listener)
        except BaseException as error:
            why = str(error) or "interrupted"
            handover.last = Message(ENDED, {"state": "failed", "reason": why})
            raise
        handover.last = Message(ENDED, {"state": "done", "reason": ""})


@contextmanager
def beside_nodes(settings: ViewSettings, where: str, listener: ScanListener) -> Iterator[None]:
    """Show what the nodes of a scan publish while it runs."""
    with _viewing(NODES, where, settings, listener):
        yield


@contextmanager
def _viewing(
    source: str, where: str, settings: ViewSettings, listener: ScanListener
) -> Iterator[Handover]:
    """Run the viewer's process; at the end it has a moment to show the rest."""
    ours, theirs = socket.socketpair()
    with ours, TemporaryFile("w+", encoding="utf-8") as output:
        os.utime(output.fileno(), (0, 0))
        with theirs:
            code = run_after(settings.niceness, _RUN)
            process = subprocess.Popen(  # noqa: S603 - our own interpreter and module
                [sys.executable, "-P", "-c", code, str(theirs.fileno()), source, where],
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=output,
                pass_fds=[theirs.fileno()],
                start_new_session=True,
            )
        handover = Handover(ours, settings)
        try:
            yield handover
        finally:
            handover.finish()
            if left := _left(process, output, settings):
                listener.say(f"--view: {left}")
            handover.close()
            output.seek(0)
            if process.returncode and (said := output.read().strip()):
                listener.say(f"--view: {said.splitlines()[-1]}")


def _left(process: "subprocess.Popen[bytes]", output: IO[str], settings: ViewSettings) -> str:
    """Let the viewer show the rest as long as it goes on; say where it has not shown it."""
    began = changed = time.monotonic()
    last = _sign(output)
    while process.poll() is None:
        now, sign = time.monotonic(), _sign(output)
        if sign != last:
            changed, last = now, sign
        stopped = os.WSTOPPED | os.WNOHANG | os.WNOWAIT
        begun = sign or os.waitid(os.P_PID, process.pid, stopped) is not None
        patience = settings.closing if begun else settings.opening
        if now > min(changed + patience, began + settings.finishing):
            return "the viewer is behind, and the scan did not wait for it: 'afm-scan view' the bag"
        time.sleep(settings.refresh)
    return ""


def _sign(output: IO[str]) -> int:
    """Return the last sign of the viewer's process, which sets its output's time; 0 for none."""
    return os.fstat(output.fileno()).st_mtime_ns


_SETTINGS = ViewSettings()
VIEW = ScanView(
    help="Open a viewer beside the scan, or name a file to write that it shows later.",
    usual=WINDOW,
    refuse=partial(refuse, option="--view"),
    beside_pipeline=partial(beside_pipeline, _SETTINGS),
    beside_nodes=partial(beside_nodes, _SETTINGS),
)
