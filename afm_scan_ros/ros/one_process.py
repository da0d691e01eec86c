"""The rclpy replacement without DDS: the nodes of one process, in one thread.

Messages are serialised to CDR, as over DDS, so that nodes compute the same results. No other
process is reached, so that a service is never called.
"""

from collections import deque

from attrs import define, field

from afm_scan_ros.ros.common import Message
from afm_scan_ros.ros.cyclone.base import (
    Arguments,
    DurabilityPolicy,
    HistoryPolicy,
    Joined,
    Logger,
    QoSProfile,
)


class Unheard(Logger):
    """Writes nothing: the command reports errors, as it does for nodes in other processes."""

    def _write(self, level: str, message: str) -> None:
        """Leave it."""


@define(eq=False)
class ProcessWaker:
    """Tells an executor that there is more to wait for."""

    waiting: bool = False

    def set(self, value: bool) -> None:  # noqa: FBT001 - the binding's
        """Tell it."""
        self.waiting = value

    def take(self) -> None:
        """Forget it."""
        self.waiting = False


@define(eq=False)
class Endpoint:
    """A reader or a writer: what waits to be read, or what a latched writer keeps for later."""

    topic: str
    type_name: str
    context: "ProcessContext"
    waiting: deque[bytes]

    def take_valid(self) -> bytes | None:
        """Return the next message, or None."""
        return self.waiting.popleft() if self.waiting else None

    def write_cdr(self, cdr: bytes) -> None:
        """Send one message; a latched writer keeps its last ones for later."""
        self.waiting.append(cdr)
        for reader in self.context.readers_of(self.topic):
            reader.waiting.append(cdr)

    def any_sample(self) -> "Endpoint":
        """Return what an executor waits for."""
        return self

    def writer_count(self) -> int:
        """Count the writers whose messages come here."""
        return len(self.context.writers_of(self.topic))

    def reader_count(self) -> int:
        """Count the readers that get what is written."""
        return len(self.context.readers_of(self.topic))


@define(eq=False)
class ProcessWaits:
    """What an executor waits for; none of it comes while this thread would wait."""

    _attached: dict[int, Endpoint | ProcessWaker] = field(factory=dict)

    def add(self, entity: Endpoint | ProcessWaker, number: int) -> None:
        """Wait for it too, under a number of its own."""
        self._attached[number] = entity

    def detach(self, entity: Endpoint) -> None:
        """Wait for it no longer."""
        self._attached = {n: each for n, each in self._attached.items() if each is not entity}

    def there(self, nanoseconds: int) -> list[int]:  # noqa: ARG002 - wire.py's
        """Return the numbers of those that are ready."""
        return [number for number, each in self._attached.items() if each.waiting]


@define(eq=False)
class ProcessEntities:
    """The readers and writers of one node."""

    context: "ProcessContext"
    name: str
    _readers: list[Endpoint] = field(factory=list)
    _writers: list[Endpoint] = field(factory=list)

    def reader(self, name: str, message: type[Message], qos: QoSProfile) -> Endpoint:
        """Make the reader of a topic; the last messages of its latched writers are queued."""
        made = Endpoint(name, message.__msgtype__, self.context, deque(maxlen=_depth(qos)))
        if qos.durability == DurabilityPolicy.TRANSIENT_LOCAL:
            for writer in self.context.writers_of(name):
                made.waiting.extend(writer.waiting)
        self._readers.append(made)
        self.context.readers.append(made)
        return made

    def writer(self, name: str, message: type[Message], qos: QoSProfile) -> Endpoint:
        """Make the writer of a topic."""
        latched = qos.durability == DurabilityPolicy.TRANSIENT_LOCAL
        kept: deque[bytes] = deque(maxlen=_depth(qos) if latched else 0)
        made = Endpoint(name, message.__msgtype__, self.context, kept)
        self._writers.append(made)
        self.context.writers.append(made)
        return made

    def end(self) -> None:
        """Take all of them away."""
        self.context.names.remove(self.name)
        for reader in self._readers:
            self.context.readers.remove(reader)
        for writer in self._writers:
            self.context.writers.remove(writer)


@define(eq=False)
class ProcessContext(Joined):
    """All endpoints of the process, and the arguments of the node that is made next."""

    names: list[str] = field(factory=list)
    readers: list[Endpoint] = field(factory=list)
    writers: list[Endpoint] = field(factory=list)
    logger: type[Logger] = Unheard
    waits: type[ProcessWaits] = ProcessWaits
    waker: type[ProcessWaker] = ProcessWaker

    def entities(self, namespace: str, name: str, logger: Logger) -> ProcessEntities:  # noqa: ARG002 - domain.py's
        """Return what makes the readers and writers of a node."""
        self.names.append(name)
        return ProcessEntities(self, name)

    def node_names(self) -> list[str]:
        """Names of the nodes."""
        return self.names

    def readers_of(self, topic: str) -> list[Endpoint]:
        """Return the readers of a topic."""
        return [each for each in self.readers if each.topic == topic]

    def writers_of(self, topic: str) -> list[Endpoint]:
        """Return the writers of a topic."""
        return [each for each in self.writers if each.topic == topic]

    def writer_types(self, topic: str) -> list[str]:
        """Types of the writers of a topic, one for each."""
        return [each.type_name for each in self.writers_of(topic)]

    def reader_types(self, topic: str) -> list[str]:
        """Types of the readers of a topic, one for each."""
        return [each.type_name for each in self.readers_of(topic)]

    def end(self) -> None:
        """Do nothing: no other process knows this one."""


def join(arguments: Arguments) -> ProcessContext:
    """Begin a graph of this process alone."""
    return ProcessContext(arguments)


def _depth(qos: QoSProfile) -> int | None:
    return None if qos.history == HistoryPolicy.KEEP_ALL else qos.depth
