"""Base of nodes that only read: they follow a scan, or a bag that is played."""

from afm_scan_ros.nodes.block_consumer import BlockConsumer
from afm_scan_ros.nodes.block_guard import ReceivedBlock
from afm_scan_ros.nodes.peers import DONE
from afm_scan_ros.nodes.topics import NodeTopic


class StreamReader(BlockConsumer):
    """A consumer that moves nothing, so that it may wait for any block as long as it takes.

    A bag is played where no node of the source's name has been there since the scan's announcement.
    Then no silence counts, and no state that the bag holds: those nodes are gone.
    """

    def __init__(self) -> None:
        super().__init__()
        self._source_was_there = False

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

    def receive(self, topic: NodeTopic, message: ReceivedBlock) -> None:
        """Take the next block; a bag does not wait until the node is ready for the first."""
        while not self.leaving and self.prepares():
            pass
        super().receive(topic, message)
