"""Files that are read and written; where the package's own lie, however it was installed."""

from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

PACKAGE = "afm_scan_ros"


def share_directory() -> Path:
    """Return the folder that holds ``package.xml``, ``msg/`` and ``config/``.

    That is the source tree where the package runs from it, as after ``pip install -e``; else
    ``PREFIX/share/afm_scan_ros``, where both pip and colcon put it. PREFIX is some parent of the
    installed Python files. Raises FileNotFoundError for a broken installation.
    """
    parents = Path(__file__).absolute().parents
    candidates = [parents[2], *(parent / "share" / PACKAGE for parent in parents)]
    for candidate in candidates:
        if (candidate / "package.xml").is_file() and (candidate / "msg").is_dir():
            return candidate
    raise FileNotFoundError(
        f"{PACKAGE} is installed at {parents[1]} but its msg/ and config/ are in no"
        f" share/{PACKAGE} above it: install it again"
    )


def version() -> str:
    """Version of the package, as package.xml states it."""
    root = ET.parse(share_directory() / "package.xml").getroot()  # noqa: S314 - our own file
    return str(root.findtext("version"))


def own_types() -> dict[str, Any]:
    """Return the package's messages by name, ``afm_scan_ros/msg/ScanInfo``, for a typestore."""
    from rosbags.typesys import get_types_from_msg  # noqa: PLC0415 - slow, and few need it

    types: dict[str, Any] = {}
    for path in sorted((share_directory() / "msg").glob("*.msg")):
        types.update(get_types_from_msg(path.read_text("utf-8"), f"{PACKAGE}/msg/{path.stem}"))
    return types
