"""The process that feeds the viewer during a scan: best effort, and of low priority."""

import os
import socket
import sys
import time
from collections.abc import Callable, Iterator

from attrs import define, field

from afm_scan_ros.bag.scan_info import decode_info
from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.streams import ACHIEVED, LineError, end
from afm_scan_ros.core.types import Trace
from afm_scan_ros.drivers.link import Link, Message
from afm_scan_ros.features.view.blocks import ShownBlocks
from afm_scan_ros.features.view.handover import (
    BLOCK,
    DOING,
    ENDED,
    LEFT_OUT,
    LINE,
    MISSING,
    NODES,
    SAY,
    SCAN,
)
from afm_scan_ros.features.view.screen import Screen, open_screen
from afm_scan_ros.features.view.viewer import WINDOW, ViewSettings, open_window

SCAN_PART = "scan"
"""Name of what is a scan in one process, in the table of states."""


def main(descriptor: str, source: str, where: str) -> None:
    """Show a scan until it is over or the viewer is closed."""
    settings = ViewSettings()
    link = Link(socket.socket(fileno=int(descriptor)))
    try:
        viewer = open_window(settings) if where == WINDOW else None

        def wanted() -> bool:
            os.utime(sys.stdout.fileno())  # the sign that this process goes on
            return viewer is None or viewer.poll() is None

        if source == NODES:
            from afm_scan_ros.features.view.listening import listen  # noqa: PLC0415 - needs ROS

            listen(where, settings, lambda: wanted() and not _is_over(link))
        else:
            show_link(link, where, settings, wanted)
    except (InputError, ScanError, OSError) as error:
        sys.exit(str(error))


def _is_over(link: Link) -> bool:
    """Return whether the scan that started this process has closed its end."""
    try:
        while link.readable(0.0):
            link.receive()
    except (EOFError, OSError):
        return True
    return False


def show_link(link: Link, where: str, settings: ViewSettings, wanted: Callable[[], bool]) -> None:
    """Show what comes over a link, as long as it is ``wanted``."""
    shown = None
    for messages in _batches(link, settings.refresh):
        for message in messages:
            if message.kind == SCAN:
                info = decode_info(bytes.fromhex(message.fields["info"]))
                shown = ShownPipeline(open_screen(info, where, settings), settings.pixels)
            elif shown is not None:
                shown.take(message)
        if not wanted():
            return
        if shown is not None:
            shown.screen.refresh()
    if shown is not None:
        shown.end()


def _batches(link: Link, interval: float) -> Iterator[list[Message]]:
    """Yield what comes within each interval (s), until the link closes."""
    try:
        while True:
            batch, deadline = [], time.monotonic() + interval
            while link.readable(max(0.0, deadline - time.monotonic())):
                batch.append(link.receive())
                if time.monotonic() > deadline:
                    break
            yield batch
    except (EOFError, OSError):
        yield batch


@define(eq=False)
class ShownPipeline:
    """A scan in one process, as its messages tell of it."""

    screen: Screen
    _pixels: int
    _blocks: ShownBlocks = field(init=False)
    _sample: int = field(default=0, init=False)
    _is_over: bool = field(default=False, init=False)

    def __attrs_post_init__(self) -> None:
        self._blocks = ShownBlocks(self.screen, self._pixels)

    def take(self, message: Message) -> None:
        """Show what a message tells."""
        fields = message.fields
        if message.kind == BLOCK:
            first = fields["first_sample"]
            block = Trace(first, self.screen.info.sample_period, *message.samples)
            self._blocks.add(fields["name"], block)
            if fields["name"] == ACHIEVED:
                self._sample = end(block)
                self._state("running", "")
        elif message.kind == LINE:
            self.screen.line(fields["name"], LineError(**fields["figures"]))
        elif message.kind == DOING:
            self._state("ready", fields["what"])
        elif message.kind == ENDED:
            self._is_over = True
            self._state(fields["state"], fields["reason"])
            why = fields["reason"]
            ended = f"the scan has failed: {why}" if why else "the scan is done"
            self.screen.say(ended, self._sample, "WARN" if why else "INFO")
        elif message.kind == SAY:
            self.screen.say(fields["text"], self._sample)
        elif message.kind == LEFT_OUT:
            self.screen.say(f"{fields['count']} blocks or news are {MISSING}", self._sample)

    def end(self) -> None:
        """Show the last of it, and say where that is not the end of the scan."""
        if not self._is_over:
            why = f"what follows is {MISSING}"
            self._state("no longer shown", why)
            self.screen.say(why, self._sample)
        self.screen.refresh(last=True)

    def _state(self, state: str, reason: str) -> None:
        self.screen.state(SCAN_PART, state, self._sample, reason)
