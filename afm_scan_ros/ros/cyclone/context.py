"""The process's part in the DDS domain: one participant, whatever the number of nodes."""

import atexit
import sys
from collections.abc import Sequence
from contextlib import nullcontext

from attrs import define, field
from cyclonedds.core import DDSException, GuardCondition
from cyclonedds.qos import Policy, Qos

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.ros.cyclone.base import NotInitializedError, SignalHandlerOptions
from afm_scan_ros.ros.cyclone.discovery import (
    configuration,
    domain_id,
    kept_to_loopback,
    stays_here,
)
from afm_scan_ros.ros.cyclone.graph import Graph
from afm_scan_ros.ros.cyclone.names import Arguments, parse_arguments
from afm_scan_ros.ros.cyclone.wire import OwnDomain, Participant


@define(eq=False)
class Context:
    """What ``init`` makes and ``shutdown`` ends."""

    arguments: Arguments
    domain: OwnDomain
    participant: Participant
    graph: Graph
    wakers: list[GuardCondition] = field(factory=list)

    def wake(self) -> None:
        """Let every executor look at what it waits for again."""
        for waker in self.wakers:
            waker.set(True)


_current: list[Context] = []


def init(
    *,
    args: Sequence[str] | None = None,
    signal_handler_options: SignalHandlerOptions = SignalHandlerOptions.NO,
) -> None:
    """Join the domain, with the ROS arguments of ``args`` (``sys.argv`` if None).

    Raises RuntimeError if that is done already, InputError for arguments or an environment that
    do not hold.
    """
    if _current:
        raise RuntimeError("init was called twice without a shutdown between")
    if signal_handler_options is not SignalHandlerOptions.NO:
        raise ValueError("init takes no signals over here: pass SignalHandlerOptions.NO")
    arguments = parse_arguments(sys.argv if args is None else args)
    domain, participant = _join(domain_id())
    _current.append(Context(arguments, domain, participant, Graph(participant)))


def _join(number: int) -> tuple[OwnDomain, Participant]:
    try:
        with kept_to_loopback() if stays_here() else nullcontext():
            domain = OwnDomain(number, configuration())
            return domain, Participant(number, Qos(Policy.Userdata(b"enclave=/;")))
    except DDSException as error:
        raise InputError(
            f"ROS_DOMAIN_ID = {number}: the domain cannot be joined; check CYCLONEDDS_URI, and that"
            " fewer than 33 processes are in a domain of range LOCALHOST"
        ) from error


def shutdown() -> None:
    """Leave the domain; raises RuntimeError if it was not joined."""
    context = current_context()
    _current.clear()
    context.wake()
    context.participant.end()
    context.domain.end()  # the next may have other settings


def try_shutdown() -> None:
    """Leave the domain if it was joined."""
    if ok():
        shutdown()


atexit.register(try_shutdown)  # or the others would count this process for ten seconds more


def ok() -> bool:
    """Return whether the domain is joined."""
    return bool(_current)


def current_context() -> Context:
    """Return what ``init`` made; raises NotInitializedError before it and after shutdown."""
    if not _current:
        raise NotInitializedError("call init first")
    return _current[0]
