"""What all backends of ROS share: the type of a message, and parameters that no node declares."""

from typing import Any, TypeAlias

# Made from .msg files at run time, by rosidl or by the Cyclone backend.
Message: TypeAlias = Any


def undeclared_parameters(node: Any) -> list[str]:  # noqa: ANN401 - rclpy's Node or its replacement
    """Names that the command line or a parameter file set and the node never declared."""
    given = node._parameter_overrides  # noqa: SLF001 - rclpy has no public name for it
    return sorted(
        name
        for name in given
        if not name.startswith("qos_overrides.") and not node.has_parameter(name)
    )
