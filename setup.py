"""What pyproject.toml cannot say: what stands in files that colcon reads too."""

import re
from pathlib import Path

from setuptools import setup

HERE = Path(__file__).parent
SHARE = "share/afm_scan_ros"


def version() -> str:
    """Return the version in package.xml, the only place that states it."""
    found = re.search(r"<version>(.+?)</version>", (HERE / "package.xml").read_text("utf-8"))
    if found is None:
        raise ValueError("package.xml states no <version>")
    return found[1]


def executables() -> list[str]:
    """Return the lines ``name = module:function`` that CMakeLists.txt reads too.

    Without ROS the nodes run as ``afm-scan run NAME``, so only the command itself is installed.
    """
    lines = (HERE / "resource/executables.txt").read_text("utf-8").splitlines()
    return [line for line in lines if line.startswith("afm-scan ")]


def data(folder: str) -> tuple[str, list[str]]:
    """Return the files of a folder with the place where both kinds of installation look."""
    files = sorted(p for p in (HERE / folder).iterdir() if p.is_file())
    return (f"{SHARE}/{folder}", [str(p.relative_to(HERE)) for p in files])


setup(
    version=version(),
    data_files=[
        data("msg"),
        data("config"),
        data("config/layouts"),
        data("config/changing"),
        data("config/plants"),
        data("config/sros2"),
        data("launch"),
        (SHARE, ["package.xml"]),
    ],
    entry_points={"console_scripts": executables()},
)
