"""What all backends of ROS share: the type of a message, and which backend there is."""

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
