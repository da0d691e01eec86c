"""What all backends of ROS share: messages, which backend there is, settings of Cyclone DDS.

``rmw_cyclonedds_cpp`` and the replacement of rclpy read the settings from CYCLONEDDS_URI when the
domain is joined, fragment by fragment; the last fragment that names a setting decides. Fast DDS
ignores them. With them no foreign reader can stop a node of a scan.
"""

import os
from collections.abc import Mapping, MutableMapping
from importlib import import_module
from importlib.util import find_spec
from typing import Any, TypeAlias

# Made from .msg files at run time, by rosidl or by the Cyclone backend.
Message: TypeAlias = Any


def _why_alone() -> str:
    """Return why no other process can be reached; nothing where it can be."""
    if find_spec("rclpy") is not None:
        return ""
    try:
        import_module("cyclonedds")
    except ImportError as error:
        return str(error)
    return ""


ALONE = _why_alone()
"""Why all nodes must run in one process, or nothing."""


def undeclared_parameters(node: Any) -> list[str]:  # noqa: ANN401 - rclpy's Node or its replacement
    """Names that the command line or a parameter file set and the node never declared."""
    given = node._parameter_overrides  # noqa: SLF001 - rclpy has no public name for it
    return sorted(
        name
        for name in given
        if not name.startswith("qos_overrides.") and not node.has_parameter(name)
    )


URI = "CYCLONEDDS_URI"

# A writer blocks above the high mark, half a megabyte by itself. A reader whose process was stopped
# or killed is a reader until its lease ends: 10 s, and 20 s in Fast DDS. At 2 MHz, more than a
# chain of nodes can pass on, 16 bytes a sample make 640 MB in 20 s. Memory is taken when it is
# needed. Until readers acknowledge what was sent it is kept. They are asked with a message that
# comes 4/5 of the heartbeat's interval, 100 ms by itself, after the one before.
_KEPT = (
    "<HeartbeatInterval>6 ms</HeartbeatInterval><Watermarks><WhcHigh>640 MB</WhcHigh>"
    "<WhcHighInit>640 MB</WhcHighInit><WhcAdaptive>false</WhcAdaptive></Watermarks>"
)

# What comes while a process's receiving thread waits for a core has to fit in here, or is lost and
# sent again when asked for; 1 MB by itself. A system may allow less.
_ROOM = '<SocketReceiveBufferSize max="4 MB"/>'

# Each writer of a node that ends waits so long for readers that may have been killed.
_LINGER = "<WriterLingerDuration>0.2 s</WriterLingerDuration>"

NODE_SETTINGS = (
    f"<CycloneDDS><Domain><Internal>{_KEPT}{_ROOM}{_LINGER}</Internal></Domain></CycloneDDS>"
)


def use_node_settings(environment: MutableMapping[str, str] = os.environ) -> None:
    """Put the settings before what the user wrote in CYCLONEDDS_URI, which so prevails."""
    given = users_settings(environment)
    environment[URI] = f"{NODE_SETTINGS},{given}" if given else NODE_SETTINGS


def users_settings(environment: Mapping[str, str] = os.environ) -> str:
    """Return what the user wrote in CYCLONEDDS_URI."""
    return environment.get(URI, "").removeprefix(NODE_SETTINGS).removeprefix(",")
