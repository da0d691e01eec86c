"""The view of a scan by nodes: it reads their monitors' topics and states."""

import os
import re
import time
from pathlib import Path

import pytest

from afm_scan_ros.bag.mcap_file import messages
from afm_scan_ros.bag.reader import read_scan
from afm_scan_ros.bag.typestore import decode
from afm_scan_ros.cli.processes import _OURS as OURS
from afm_scan_ros.cli.processes import isolate
from helpers.viewed import COMMAND, command, curve, states

pytest.importorskip("rclpy", reason="there is no ROS 2 here")
pytest.importorskip("rerun", reason="the viewer is not installed: pip install 'afm_scan_ros[view]'")

SPEC = """\
/**/trajectory_generator:
  ros__parameters: {range_x_um: 10.0, range_y_um: 10.0, line_rate_hz: 50.0, lines: 60,
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


@pytest.fixture
def domain(monkeypatch: pytest.MonkeyPatch) -> str:
    """A domain of the test's own, as a user sets one."""
    monkeypatch.setenv("ROS_DOMAIN_ID", "")
    monkeypatch.setenv(OURS, "")
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    isolate()
    monkeypatch.setenv(OURS, "")
    return os.environ["ROS_DOMAIN_ID"]


def test_the_monitors_and_the_states_of_nodes_are_shown(tmp_path: Path, domain: str) -> None:
    """It may miss some of it, but shows nothing else than is recorded, and ends with the scan."""
    spec, bag, file = tmp_path / "scan.yaml", tmp_path / "bag", tmp_path / "scan.rrd"
    spec.write_text(SPEC, "utf-8")
    view = command("view", "--save", file, code=COMMAND)
    while not listens(view.pid):
        assert view.poll() is None, view.communicate()
        time.sleep(0.1)
    scan = command("scan", "--spec", spec, "--bag", bag, "--watch", code=COMMAND)
    out, said = scan.communicate()
    assert (scan.returncode, out) == (0, f"Recorded {bag}.\n"), (said, domain)
    out, said = view.communicate()
    others = [line for line in said.splitlines() if "of killed processes" not in line]
    assert (view.returncode, out, others) == (0, "", [])
    for path, topic in (("error", "/tracking_error"), ("residual", "/model_residual")):
        shown = {round(value, 6) for value in curve(file, f"/lines/{path}/max_x")[1]}
        assert shown <= figures(bag, topic)
    curves = ("displacement/achieved", "displacement/desired", "error", "drive")
    assert sum(len(curve(file, f"/{curve_of}/x")[1]) for curve_of in curves) > 100
    rows = dict(re.findall(r"^\| (\w+) \| (\w+) \|", states(file), re.MULTILINE)[1:])
    assert rows
    assert rows.keys() <= set(NODES)


def test_a_scan_by_nodes_opens_its_view_and_ends_with_it(tmp_path: Path) -> None:
    spec, bag, file = tmp_path / "scan.yaml", tmp_path / "bag", tmp_path / "scan.rrd"
    spec.write_text(SPEC, "utf-8")
    scan = command("scan", "--spec", spec, "--bag", bag, "--view", file, code=COMMAND)
    _, said = scan.communicate()
    assert scan.returncode == 0, said
    assert read_scan(bag).warnings == ()
    assert "--view: " not in said


def listens(pid: int) -> bool:
    """Whether a process has joined ROS: a thread of DDS is there, and a moment has passed."""
    threads = Path(f"/proc/{pid}/task").glob("*/comm")
    joined = any(each.read_text("utf-8").startswith(("dds.", "recv")) for each in threads)
    if joined:
        time.sleep(1.0)
    return joined
