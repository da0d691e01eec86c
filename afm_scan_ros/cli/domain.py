"""A DDS domain of this command's own, on this machine alone."""

import os
import socket

from afm_scan_ros.core.errors import ScanError

_FIRST, _COUNT = 1, 101  # ROS 2's domains whose ports no system hands out otherwise


_OURS = "AFM_SCAN_DOMAIN_ID"
"""Variable that distinguishes a domain chosen here from the user's."""


def isolate() -> None:
    """Set ROS_DOMAIN_ID to a domain that nobody uses, and keep it on loopback.

    Does nothing where the user has set one; one chosen for an earlier scan may be another's by
    now, and is chosen anew. Raises ScanError if all are in use.
    """
    given = os.environ.get("ROS_DOMAIN_ID")
    if given is not None and given != os.environ.get(_OURS):
        return
    start = os.getpid()
    for offset in range(_COUNT):
        domain = _FIRST + (start + offset) % _COUNT
        if _is_free(domain):
            os.environ["ROS_DOMAIN_ID"] = os.environ[_OURS] = str(domain)
            os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
            return
    raise ScanError("all DDS domains are in use: set ROS_DOMAIN_ID to a free one")


def _is_free(domain: int) -> bool:
    """Tell whether the port of a domain's first participant is (DDSI-RTPS 2.2, 9.6.1)."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.bind(("127.0.0.1", 7410 + 250 * domain))
        except OSError:
            return False
    return True
