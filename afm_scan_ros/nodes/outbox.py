"""Publishes messages in order, also those that DDS does not take at once."""

from collections import deque

from attrs import define, field

from afm_scan_ros.core.errors import ScanError
from afm_scan_ros.ros import Message, Publisher, RCLError

AFTERLIFE = 22.0
"""Seconds for which DDS may count a killed process's endpoints: 10, and 20 in Fast DDS."""


@define(eq=False)
class Outbox:
    """The messages of one publisher that are still to be sent.

    A reader whose process was stopped or killed acknowledges nothing. After 5000 messages Fast DDS
    refuses the next one, a tenth of a second after it was given. It is then offered again.
    """

    publisher: Publisher
    _waiting: deque[Message] = field(factory=deque, init=False)
    _refused_since: float | None = field(default=None, init=False)

    def send(self, message: Message, now: float) -> None:
        """Publish a message after those that wait; ``now`` (s) is of any steady clock."""
        self._waiting.append(message)
        self.flush(now)

    def flush(self, now: float) -> bool:
        """Publish what waits; return whether all is sent.

        Raises ScanError where DDS has refused for longer than it counts a killed reader.
        """
        while self._waiting:
            try:
                self.publisher.publish(self._waiting[0])
            except RCLError as error:
                self._look_at(error, now)
                return False
            self._waiting.popleft()
            self._refused_since = None
        return True

    def _look_at(self, error: RCLError, now: float) -> None:
        if self._refused_since is None:
            self._refused_since = now
        if now - self._refused_since > AFTERLIFE:
            topic = self.publisher.topic_name
            raise ScanError(
                f"{topic} cannot be published for {AFTERLIFE:g} s: {error}; end the node that reads"
                " it and does not answer"
            ) from error
