"""Quality of service under rclpy's names."""

from enum import IntEnum

from attrs import frozen


class HistoryPolicy(IntEnum):
    """How many samples are kept; numbers as in rmw/types.h."""

    KEEP_LAST = 1
    KEEP_ALL = 2


class ReliabilityPolicy(IntEnum):
    """Whether a lost sample is sent again."""

    RELIABLE = 1
    BEST_EFFORT = 2


class DurabilityPolicy(IntEnum):
    """Whether a reader that comes late still gets what was written."""

    TRANSIENT_LOCAL = 1
    VOLATILE = 2


@frozen(kw_only=True)
class QoSProfile:
    """Policies of one publisher or subscription; the defaults are ROS 2's.

    Raises ValueError for keep-last without a depth, as rclpy does.
    """

    history: HistoryPolicy = HistoryPolicy.KEEP_LAST
    depth: int = 0
    reliability: ReliabilityPolicy = ReliabilityPolicy.RELIABLE
    durability: DurabilityPolicy = DurabilityPolicy.VOLATILE

    def __attrs_post_init__(self) -> None:
        if self.history == HistoryPolicy.KEEP_LAST and self.depth < 1:
            raise ValueError("QoSProfile: history KEEP_LAST needs a depth of at least 1")


def profile_of(qos: QoSProfile | int) -> QoSProfile:
    """Return a profile where rclpy takes a profile or a depth."""
    return qos if isinstance(qos, QoSProfile) else QoSProfile(depth=qos)
