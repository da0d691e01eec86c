"""Bases of nodes that read blocks: of all, of those that only read, and of owners of hardware."""

import time
from abc import abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from functools import partial

from afm_scan_ros.bag.scan_info import encode_block, info_from_message
from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.scan_info import ScanInfo
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.types import Trace
from afm_scan_ros.nodes.messages import BlockGuard, Message, Outbox
from afm_scan_ros.nodes.parameters import NodeParameter
from afm_scan_ros.nodes.peers import DONE, READY, RUNNING
from afm_scan_ros.nodes.scan_node import ScanNode
from afm_scan_ros.nodes.topics import SCAN_INFO, NodeTopic


def min_subscriptions(readers: int, of: str = "") -> NodeParameter:
    """Declare how many readers a topic has; ``of`` tells a node's second topic from its first."""
    return NodeParameter(
        f"min_{of}subscriptions", readers, "Readers that the node waits for", low=0
    )


def spec_of(info: ScanInfo) -> ScanSpec:
    """Return the specification of a scan; raises InputError for a record that has no lines."""
    if info.spec is None:
        raise InputError(f"scan_info: '{info.pattern}' is a calibration record without lines")
    return info.spec


class BlockConsumer(ScanNode):
    """A node between the source of a scan and its end.

    A subclass names its topics, may work in ``prepare`` before it is ready, and gets each sample
    of each topic once, in order, in ``consume``.
    """

    def __init__(self) -> None:
        super().__init__()
        self._followed: list[NodeTopic] = []
        self._block_guards: dict[str, BlockGuard] = {}
        self._preparation: Iterator[str] | None = None
        self._outputs: dict[str, tuple[Outbox, int]] = {}
        self.listen_to(SCAN_INFO)
        self.subscribe(SCAN_INFO, self._meet)

    @abstractmethod
    def consume(self, topic: NodeTopic, block: Trace, *, last: bool) -> None:
        """Use a block of a topic."""

    def prepare(self, info: ScanInfo) -> Iterator[str]:  # noqa: ARG002 - a subclass's to use
        """Get ready for the scan, in pieces short enough for the heartbeat, each named."""
        yield from ()

    def read(self, topics: Sequence[NodeTopic]) -> None:
        """Subscribe to topics of blocks."""
        for topic in topics:
            self.expect(topic)
            self.subscribe(topic, partial(self.receive, topic), raw=True)

    def expect(self, topic: NodeTopic) -> None:
        """Take a topic as one whose every block is to be received."""
        self.listen_to(topic)
        self._followed.append(topic)

    def write(self, topic: NodeTopic, readers: int) -> None:
        """Publish a topic that must have a number of readers before the node is ready.

        Once, however often it is called.
        """
        if topic.name in self._outputs:
            return
        publisher = self.create_publisher(topic.kind, topic.name, topic.writer)
        self._outputs[topic.name] = (Outbox(publisher), readers)

    def publish(self, topic: NodeTopic, message: Message | bytes) -> None:
        """Publish a message, or one that is serialised already."""
        self._outputs[topic.name][0].send(message, time.monotonic())

    def send(self, topic: NodeTopic, block: Trace, *, last: bool) -> None:
        """Publish a block."""
        self.publish(topic, encode_block(topic.type_name, self.scan, block, last=last))

    def step(self) -> bool:
        """Prepare, declare the node ready when its topics are there, leave when the source does."""
        if self.prepares():
            return True
        if self.info is not None and self.state == READY:
            self.reason = self._hindrance()
            if not self.reason and not self.ready:
                self.pin_publishers()
            self.take_part(ready=not self.reason)
        now = time.monotonic()
        unsent = [outbox for outbox, _ in self._outputs.values() if not outbox.flush(now)]
        if self.is_over() and not unsent and not self.awaited():
            self.leave()
        return False

    def prepares(self) -> bool:
        """Do the next piece of the preparation; return whether there was any left to do."""
        if self._preparation is None:
            return False
        self.reason = next(self._preparation, "")
        if not self.reason:
            self._preparation = None
        return True

    def is_over(self) -> bool:
        """Return whether the scan is over for this node and its source."""
        return self.state == DONE and self.peers.state(self.scan.nodes[0]) == DONE

    def awaited(self) -> tuple[str, ...]:
        """Return the topics that still hold the node when the scan is over."""
        return ()

    def watched(self) -> tuple[str, ...]:
        """Return the source once there is a scan, all nodes while it runs, none when it is over."""
        if self.info is None:
            return ()
        source = self.info.nodes[0]
        silent_after = {RUNNING: self.peers.names, DONE: ()}
        return silent_after.get(self.peers.state(source) or READY, (source,))

    def figures(self) -> Mapping[str, object]:
        """Return also how many times faster than real time the node could be."""
        figures, worked = super().figures(), self.working_time()
        if not worked or self.info is None:
            return figures
        margin = self.next_sample * self.info.sample_period / worked
        return {**figures, "real_time_margin": f"{margin:.3g}"}

    def working_time(self) -> float:
        """Return how long the node has worked (s)."""
        return self.busy

    def receive(self, topic: NodeTopic, cdr: bytes, number: int) -> None:
        """Take the next block of a topic; raises ScanError where it is not the expected one.

        ``cdr`` is the message as it came over the wire, ``number`` its number among those of its
        publisher.
        """
        if self.leaving:
            return
        if self.refuses():
            why = self.reason or "is not ready"
            raise ScanError(f"{topic.name}: a block came while this node {why}")
        block = self.follow(topic, cdr, number)
        self.consume(topic, block, last=self._block_guards[topic.name].complete)
        self.advance()

    def refuses(self) -> bool:
        """Return whether no block of the scan can be there yet: what came is another's.

        The source waits for the nodes of its scan alone.
        """
        return self.is_unready and (self.info is None or self.get_name() in self.info.nodes)

    @property
    def is_unready(self) -> bool:
        """Whether the node is still to say that it is ready."""
        return self.state == READY and not self.ready

    def follow(self, topic: NodeTopic, cdr: bytes, number: int) -> Trace:
        """Return the block if it is the expected one; raises ScanError otherwise."""
        info = self.scan
        if topic.name not in self._block_guards:
            about = info.scan_id, info.sample_period, info.total_samples
            self._block_guards = {
                each.name: BlockGuard(each.name, each.type_name, *about) for each in self._followed
            }
        block = self._block_guards[topic.name].accept(cdr, number)
        self.note_block(block.x.size)
        if self.state == READY:
            self.go(RUNNING)
        return block

    def advance(self) -> None:
        """Report the sample up to which the node is finished; done when all topics are complete."""
        self.advance_to(min(self._block_guards[name].next_sample for name in self.counted()))
        if all(guard.complete for guard in self._block_guards.values()):
            self.go(DONE)

    def counted(self) -> Sequence[str]:
        """Return the topics whose samples are the node's progress."""
        return [topic.name for topic in self._followed]

    def _meet(self, message: Message, _: int) -> None:
        if self.info is not None:
            topic = self.resolve_topic_name(SCAN_INFO.name)
            both = f"scan '{message.scan_id}' during scan '{self.info.scan_id}'"
            raise ScanError(f"{topic} announces {both}: stop all sources but one")
        info = info_from_message(message)
        self.begin(info)
        self._preparation = self.prepare(info)

    def _hindrance(self) -> str:
        """Return which end of a topic is missing, so that no block is published without readers."""
        unread = [
            f"waits for {readers} readers of {name}"
            for name, (outbox, readers) in self._outputs.items()
            if outbox.publisher.get_subscription_count() < readers
        ]
        unheard = [f"waits for the state of {name}" for name in self.peers.unheard_since(0.0)]
        return next(filter(None, [*unread, self.crowded(), *unheard]), "")


class StreamReader(BlockConsumer):
    """A consumer that moves nothing, so that it may wait for any block as long as it takes.

    A bag is played where no node of the source's name has been there since the scan's announcement.
    Then no silence counts, and no state that the bag holds: those nodes are gone. Its first blocks
    may be heard before the announcement, since DDS finds the readers of each topic by itself.
    """

    def __init__(self) -> None:
        super().__init__()
        self._source_was_there = False
        self._early: list[tuple[NodeTopic, bytes, int]] = []
        self._early_since = 0.0

    def follows_scan(self) -> bool:
        """Return whether the source of the scan is, or was, a node of this graph."""
        if self.info is not None and not self._source_was_there:
            self._source_was_there = not set(self.info.nodes[:1]).isdisjoint(self.get_node_names())
        return self._source_was_there

    def watch(self, now: float) -> None:
        """Raise ScanError as every node does, but in a bag that is played."""
        if self.follows_scan():
            super().watch(now)

    def is_over(self) -> bool:
        """Return whether the scan is over; a bag is with its last block."""
        return super().is_over() if self.follows_scan() else self.state == DONE

    def step(self) -> bool:
        """End where blocks came, but no announcement of their scan.

        Its publisher may not be known yet, and a player's Fast DDS, whose heartbeats come every
        3 s, repeats a lost announcement no sooner.
        """
        waited = time.monotonic() - self._early_since if self._early else 0.0
        if waited > self.safety.discovery:
            self.follow(*self._early[0])  # raises
        return super().step()

    def refuses(self) -> bool:
        """Return whether a block is another's.

        Neither a bag nor a scan in which the node takes no part waits until the node is ready.
        """
        waits = self.follows_scan() and self.get_name() in self.scan.nodes
        return waits and super().refuses()

    def receive(self, topic: NodeTopic, cdr: bytes, number: int) -> None:
        """Take the next block, or keep it until the scan is announced."""
        if self.info is None:
            self._early_since = self._early_since or time.monotonic()
            self._early.append((topic, cdr, number))
            return
        while not self.leaving and self.prepares():
            pass
        super().receive(topic, cdr, number)

    def _meet(self, message: Message, number: int) -> None:
        super()._meet(message, number)
        early, self._early = self._early, []
        for each in early:
            self.receive(*each)
