"""Layouts and the topic for viewers; a test of a scan sees that a bag holds what they show."""

import json
import runpy
from pathlib import Path
from unittest.mock import patch

import setuptools
from rclpy.qos import ReliabilityPolicy

from afm_scan_ros.nodes.topics import MONITOR
from helpers.viewers import LAYOUTS

ROOT = Path(__file__).parents[2]


def panels(place: dict[str, object] | str) -> list[str]:
    """Panels that Foxglove's mosaic places."""
    if isinstance(place, str):
        return [place]
    return [name for side in ("first", "second") for name in panels(place[side])]  # type: ignore[arg-type]


def test_no_viewer_can_make_a_node_wait() -> None:
    assert MONITOR.writer.reliability == ReliabilityPolicy.BEST_EFFORT


def test_a_layout_places_each_of_its_panels() -> None:
    layout = json.loads((LAYOUTS / "foxglove.json").read_text("utf-8"))
    assert sorted(panels(layout["layout"])) == sorted(layout["configById"])


def test_the_layouts_are_installed() -> None:
    with patch.object(setuptools, "setup") as setup:
        runpy.run_path(str(ROOT / "setup.py"))
    data = dict(setup.call_args.kwargs["data_files"])
    found = {Path(name).name for name in data["share/afm_scan_ros/config/layouts"]}
    assert found == {"foxglove.json", "plotjuggler.xml"}
    assert "install(DIRECTORY config " in (ROOT / "CMakeLists.txt").read_text("utf-8")
