"""Quality of service under rclpy's names, and as DDS policies."""

from enum import IntEnum

from attrs import frozen
from cyclonedds.qos import Policy, Qos
from cyclonedds.util import duration

_FOREVER: int = duration(infinite=True)


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


def dds_qos(profile: QoSProfile, user_data: str) -> Qos:
    """Return the DDS policies of an endpoint, in XCDR1 as ROS 2 writes and reads it."""
    keep_all = profile.history == HistoryPolicy.KEEP_ALL
    history = Policy.History.KeepAll if keep_all else Policy.History.KeepLast(profile.depth)
    reliable = profile.reliability == ReliabilityPolicy.RELIABLE
    latched = profile.durability == DurabilityPolicy.TRANSIENT_LOCAL
    policies = [
        history,
        Policy.Reliability.Reliable(_FOREVER) if reliable else Policy.Reliability.BestEffort,
        Policy.Durability.TransientLocal if latched else Policy.Durability.Volatile,
        Policy.DataRepresentation(use_cdrv0_representation=True),
        Policy.Userdata(user_data.encode()),
    ]
    if latched:  # or a late reader gets the last sample only, whatever the depth
        policies.append(Policy.DurabilityService(0, history, -1, -1, -1))
    return Qos(*policies)
