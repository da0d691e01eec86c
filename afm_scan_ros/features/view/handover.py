"""Hands the blocks of a scan over to the viewer's process, which the scan never waits for."""

import socket
from collections import deque
from contextlib import suppress
from threading import Condition, Thread

from afm_scan_ros.drivers.link import Link, Message
from afm_scan_ros.features.view.viewer import ViewSettings

SCAN, BLOCK, LINE, DOING, SAY, ENDED = "scan", "block", "line", "doing", "say", "ended"
LEFT_OUT = "left_out"
"""Kinds of messages from a scan to the viewer's process."""
PIPELINE, NODES = "pipeline", "nodes"
"""What is shown: what comes over the link, or what nodes publish until the link closes."""
MISSING = "left out of this view, which was behind, not of the bag"


class Handover:
    """Sends messages by a thread of its own; of blocks that wait too long the oldest go.

    What has gone is said in a message before the next one. Where the other end is gone, all goes.
    """

    def __init__(self, end: socket.socket, settings: ViewSettings) -> None:
        self._socket, self._link = end, Link(end)
        self._room = settings.queue
        self._blocks: deque[Message] = deque()
        self._news: deque[Message] = deque(maxlen=settings.queued_news)
        self._waiting, self._left_out = 0, 0
        self._over = False
        self.last: Message | None = None  # comes after all else
        self._changed = Condition()
        Thread(target=self._send, daemon=True).start()

    def block(self, message: Message) -> None:
        """Hand over a block of samples."""
        with self._changed:
            self._blocks.append(message)
            self._waiting += message.samples.nbytes
            while self._waiting > self._room:
                self._waiting -= self._blocks.popleft().samples.nbytes
                self._left_out += 1
            self._changed.notify()

    def news(self, message: Message) -> None:
        """Hand over what has no samples."""
        with self._changed:
            self._left_out += len(self._news) == self._news.maxlen
            self._news.append(message)
            self._changed.notify()

    def finish(self) -> None:
        """Send what waits, and then the end."""
        with self._changed:
            self._over = True
            self._changed.notify()

    def close(self) -> None:
        """Send no more."""
        with suppress(OSError):  # the viewer's process is gone
            self._socket.shutdown(socket.SHUT_RDWR)

    def _send(self) -> None:
        try:
            while message := self._next():
                self._link.send(message)
            self._socket.shutdown(socket.SHUT_WR)
        except OSError:  # the viewer's process is gone
            self._room = 0.0

    def _next(self) -> Message | None:
        """Return the next message, when there is one; None after the last."""
        with self._changed:
            while not (self._news or self._blocks or self._left_out):
                if self._over:
                    message, self.last = self.last, None
                    return message
                self._changed.wait()
            if self._left_out:
                count, self._left_out = self._left_out, 0
                return Message(LEFT_OUT, {"count": count})
            if self._news:
                return self._news.popleft()
            message = self._blocks.popleft()
            self._waiting -= message.samples.nbytes
            return message
