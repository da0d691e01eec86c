"""The view of a scan by nodes: it reads their monitors' topics and states."""

import re
from pathlib import Path

import pytest

from afm_scan_ros.bag.mcap_file import messages
from afm_scan_ros.bag.typestore import decode
from helpers.viewed import COMMAND, command, curve, states

pytest.importorskip("rclpy", reason="there is no ROS 2 here")
pytest.importorskip("rerun", reason="the viewer is not installed: pip install 'afm_scan_ros[view]'")

SPEC = """\
/**/trajectory_generator:
  ros__parameters: {range_x_um: 10.0, range_y_um: 10.0, line_rate_hz: 5.0, lines: 20,
    samples_per_line: 1000, preparation_cycles: 1, scan_id: one}
"""
NODES = {
    "trajectory_generator",
    "inversion_compensator",
    "piezoscanner_sim",
    "tracking_monitor",
    "residual_monitor",
    "scan_imager",
    "scan_recorder",
}


def figures(bag: Path, topic: str) -> set[float]:
    """Largest errors in x of all lines that a bag holds, nm."""
    (file,) = bag.glob("*.mcap")
    found = (decode(m.type_name, m.cdr) for m in messages(file) if m.topic == topic)
    return {round(1e9 * each.max_x, 6) for each in found}


def test_the_monitors_and_the_states_of_nodes_are_shown(tmp_path: Path) -> None:
    """It may come late, or miss some of it, but shows nothing else than is recorded."""
    spec, bag, file = tmp_path / "scan.yaml", tmp_path / "bag", tmp_path / "scan.rrd"
    spec.write_text(SPEC, "utf-8")
    arguments = ("--spec", spec, "--bag", bag, "--watch", "--time-scale", 1, "--view", file)
    scan = command("scan", *arguments, code=COMMAND)
    out, said = scan.communicate()
    assert (scan.returncode, out) == (0, f"Recorded {bag}.\n"), said
    for path, topic in (("error", "/tracking_error"), ("residual", "/model_residual")):
        shown = {round(value, 6) for value in curve(file, f"/lines/{path}/max_x")[1]}
        assert shown
        assert shown <= figures(bag, topic)
    for curve_of in ("displacement/achieved", "displacement/desired", "error", "drive"):
        assert len(curve(file, f"/{curve_of}/x")[1]) > 100
    rows = re.findall(r"^\| (\w+) \| (\w+) \|", states(file), re.MULTILINE)[1:]
    assert {node for node, _ in rows} == NODES
