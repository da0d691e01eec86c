"""Installs the package where there is no colcon; what both need stands in files that both read."""

import re
from pathlib import Path

from setuptools import find_packages, setup

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
    name="afm_scan_ros",
    version=version(),
    description="AFM x-y scanning with creep, hysteresis and vibration inverted, for ROS 2",
    license="Apache-2.0",
    python_requires=">=3.11",
    packages=find_packages(include=["afm_scan_ros", "afm_scan_ros.*"]),
    data_files=[
        data("msg"),
        data("config"),
        data("config/plants"),
        data("launch"),
        (SHARE, ["package.xml"]),
    ],
    entry_points={"console_scripts": executables()},
    install_requires=[
        "attrs>=23.2",
        "click>=8.1",
        "matplotlib>=3.6",
        "mcap>=1.5",
        "numba>=0.59",
        "numpy>=1.26",
        "pyyaml>=6.0",
        "rich>=13.7",
        "rosbags>=0.10",
        "scipy>=1.11",
    ],
    extras_require={
        "dds": ["cyclonedds>=11"],
        "docs": [
            "ipykernel>=6.29",
            "latex2mathml>=3.77",
            "mkdocs-material>=9.7",
            "mkdocstrings[python]>=1.0",
            "nbclient>=0.10",
        ],
        "test": [
            "hypothesis>=6.90",
            "mcap-ros2-support>=0.5",
            "mypy>=1.11",
            "pytest>=7.4",
            "pytest-xdist>=3.5",
            "ruff~=0.17.5",
            "types-PyYAML",
        ],
    },
)
