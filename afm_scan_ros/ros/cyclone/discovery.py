"""Discovery settings of Cyclone DDS from ROS 2's environment variables.

As in ``rmw_cyclonedds_cpp``, they become three settings of Cyclone DDS. A domain on this machine
alone also binds its sockets to the loopback device. Otherwise Cyclone DDS sends through the given
interface only, but receives and parses packets at every address of the machine.
"""

import os
import socket
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.ros.settings import URI, users_settings

_DEVICE = b"lo\0"
_OPEN = Path("/proc/self/fd")


@contextmanager
def kept_to_loopback() -> Iterator[None]:
    """Bind the sockets that are opened within to the loopback device; Linux from 5.7 on can."""
    before = _sockets()
    yield
    for descriptor in _sockets() - before:
        with socket.socket(fileno=os.dup(descriptor)) as opened:
            if opened.family in (socket.AF_INET, socket.AF_INET6):
                with suppress(PermissionError):  # Linux before 5.7 lets none but root
                    opened.setsockopt(socket.SOL_SOCKET, socket.SO_BINDTODEVICE, _DEVICE)


def _sockets() -> set[int]:
    """Descriptors of the process that are sockets; none where there is no way to bind them."""
    if not hasattr(socket, "SO_BINDTODEVICE"):
        return set()
    return {int(each.name) for each in _OPEN.iterdir() if _is_socket(each)}


def _is_socket(descriptor: Path) -> bool:
    try:
        return str(descriptor.readlink()).startswith("socket:")
    except FileNotFoundError:  # the one that listed them
        return False


_SETTINGS = {
    "SYSTEM_DEFAULT": "",
    "SUBNET": "",
    "LOCALHOST": (
        '<General><Interfaces><NetworkInterface address="127.0.0.1" multicast="false"/>'
        "</Interfaces><AllowMulticast>false</AllowMulticast></General>"
        "<Discovery><ParticipantIndex>auto</ParticipantIndex>"
        "<MaxAutoParticipantIndex>32</MaxAutoParticipantIndex>"
        '<Peers><Peer address="127.0.0.1"/></Peers></Discovery>'
    ),
    "OFF": (
        '<General><Interfaces><NetworkInterface address="127.0.0.1" multicast="false"/>'
        "</Interfaces><AllowMulticast>false</AllowMulticast></General>"
        "<Discovery><ParticipantIndex>none</ParticipantIndex>"
        "<Tag>pid${CYCLONEDDS_PID}</Tag></Discovery>"
    ),
}


def domain_id(environment: Mapping[str, str] = os.environ) -> int:
    """Number of the DDS domain, from ROS_DOMAIN_ID; raises InputError if it is none."""
    text = environment.get("ROS_DOMAIN_ID") or "0"
    if not text.isdigit() or int(text) > 232:  # noqa: PLR2004 - the last whose ports exist
        raise InputError(f"ROS_DOMAIN_ID = {text!r}: give a whole number from 0 to 232")
    return int(text)


def stays_here(environment: Mapping[str, str] = os.environ) -> bool:
    """Return whether discovery is limited to this host; a user's CYCLONEDDS_URI is not examined."""
    reach = environment.get("ROS_AUTOMATIC_DISCOVERY_RANGE")
    return reach in ("LOCALHOST", "OFF") and not users_settings(environment)


def configuration(environment: Mapping[str, str] = os.environ) -> str:
    """Return Cyclone DDS's configuration: ROS 2's discovery range, then CYCLONEDDS_URI.

    What the user wrote in CYCLONEDDS_URI comes last, so it wins. Raises InputError for a range
    that is none of ROS 2's.
    """
    if peers := environment.get("ROS_STATIC_PEERS"):
        raise InputError(
            f"ROS_STATIC_PEERS = {peers!r}: not supported; name peers by CYCLONEDDS_URI"
        )
    reach = environment.get("ROS_AUTOMATIC_DISCOVERY_RANGE") or "SUBNET"
    if reach not in _SETTINGS:
        given = f"ROS_AUTOMATIC_DISCOVERY_RANGE = {reach!r}"
        raise InputError(f"{given}: give one of {', '.join(_SETTINGS)}")
    fragments = [
        f"<CycloneDDS><Domain>{_SETTINGS[reach]}</Domain></CycloneDDS>",
        environment.get(URI, ""),
    ]
    return ",".join(fragment for fragment in fragments if fragment)
