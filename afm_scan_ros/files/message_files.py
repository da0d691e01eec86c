"""The package's own message definitions, read from ``msg/``."""

from typing import Any

from rosbags.typesys import get_types_from_msg

from afm_scan_ros.files.share import PACKAGE, share_directory


def own_types() -> dict[str, Any]:
    """Return the definitions by name, ``afm_scan_ros/msg/ScanInfo`` and so on, for a typestore."""
    types: dict[str, Any] = {}
    for path in sorted((share_directory() / "msg").glob("*.msg")):
        types.update(get_types_from_msg(path.read_text("utf-8"), f"{PACKAGE}/msg/{path.stem}"))
    return types
