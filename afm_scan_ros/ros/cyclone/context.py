"""The process's part in the ROS graph: joined by ``init``, left by ``shutdown``."""

import atexit
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING

from afm_scan_ros.ros.common import ALONE
from afm_scan_ros.ros.cyclone.base import NotInitializedError, SignalHandlerOptions, parse_arguments

if TYPE_CHECKING or not ALONE:
    from afm_scan_ros.ros.cyclone.domain import Context, join
else:
    from afm_scan_ros.ros.one_process import ProcessContext as Context
    from afm_scan_ros.ros.one_process import join

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
    _current.append(join(parse_arguments(sys.argv if args is None else args)))


def use_arguments(words: Sequence[str]) -> None:
    """Take the ROS arguments of a command line for the nodes that are made from now on."""
    current_context().arguments = parse_arguments(words)


def shutdown() -> None:
    """Leave the domain; raises NotInitializedError if it was not joined."""
    context = current_context()
    _current.clear()
    context.end()


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
