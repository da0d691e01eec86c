"""Where Cyclone DDS cannot be imported, all nodes run in one process, and give the same."""

import os
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

from afm_scan_ros.bag.mcap_file import messages
from afm_scan_ros.bag.reader import read_scan
from afm_scan_ros.cli.options import CONFIG
from afm_scan_ros.cli.orders import ScanFiles
from afm_scan_ros.cli.scan import run_scan
from afm_scan_ros.core.identification.drives.experiments import EXPERIMENTS
from afm_scan_ros.core.model import INVERSES
from afm_scan_ros.core.types import AXES
from helpers.in_process import default_plant, drive_through

pytestmark = pytest.mark.skipif(find_spec("rclpy") is not None, reason="nodes run by ROS 2")

PLANT = CONFIG / "plant.yaml"
SPEC = """\
/**/trajectory_generator:
  ros__parameters: {line_rate_hz: 100.0, lines: 4, samples_per_line: 400, block_size: 700,
    scan_id: one}
"""
BLOCKER = """\
import sys


class Blocker:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] == "cyclonedds":
            raise ModuleNotFoundError(f"No module named '{name}'", name=name)


sys.meta_path.insert(0, Blocker())
"""
AFTER_STAMP = 12
"""Bytes of a message: four of its encoding, and eight of the stamp that all topics begin with."""
MAIN = "from afm_scan_ros.cli.main import main; main()"
ONE_PROCESS = "all nodes run in this process (No module named 'cyclonedds'); install ROS 2, or"
SMALL_DEMO = "import afm_scan_ros.cli.demo as d; d.LINE_RATES = (d.SHARED_RATE,)\n"
ONE_ENTRY = """\
from afm_scan_ros.core.diagnosis import search as selection
selection.CANDIDATES = tuple(c for c in selection.CANDIDATES if c.effect.name == "drift")
"""

LATE = """\
from afm_scan_ros.nodes.tracking_monitor import TrackingMonitor as Monitor
at_once, tick, held = Monitor.publish, Monitor.tick, []


def publish(monitor, topic, message):
    held.append((topic, message))


def late(monitor):
    while monitor.leaving and held:
        at_once(monitor, *held.pop(0))
    return tick(monitor)


Monitor.publish, Monitor.tick = publish, late
"""


@pytest.fixture
def alone(tmp_path: Path) -> Path:
    """Return a folder whose ``sitecustomize`` keeps the middleware from being imported."""
    folder = tmp_path / "blocker"
    folder.mkdir()
    (folder / "sitecustomize.py").write_text(BLOCKER, "utf-8")
    return folder


def afm_scan(alone: Path, *words: object, before: str = "") -> subprocess.CompletedProcess[str]:
    path = [str(alone), *filter(None, [os.environ.get("PYTHONPATH")])]
    return subprocess.run(
        [sys.executable, "-c", before + MAIN, *map(str, words)],
        env={**os.environ, "PYTHONPATH": os.pathsep.join(path)},
        capture_output=True,
        text=True,
        check=False,
    )


def sent(bag: Path) -> dict[str, list[bytes]]:
    """Return what a bag holds of each topic, but for when the scan began: a header's stamp.

    DDS pads a message to four bytes.
    """
    found: dict[str, list[bytes]] = {}
    for file in sorted(bag.glob("*.mcap")):
        for message in messages(file):
            padded = message.cdr.ljust(-4 * (-len(message.cdr) // 4), b"\0")
            found.setdefault(message.topic, []).append(padded[AFTER_STAMP:])
    return found


def test_a_scan_is_the_same_to_the_bit(alone: Path, tmp_path: Path) -> None:
    spec = tmp_path / "scan.yaml"
    spec.write_text(SPEC, "utf-8")
    words = ["scan", "--spec", spec, "--bag", tmp_path / "alone", "--watch"]
    done = afm_scan(alone, *words)
    assert (done.returncode, done.stderr.count("\n")) == (0, 1), done.stderr
    assert done.stderr.startswith(f"afm-scan: {ONE_PROCESS}")
    files = ScanFiles(spec, CONFIG / "model.yaml", PLANT, tmp_path / "by_dds")
    run_scan(files, INVERSES, watched=True)
    one, other = (sent(tmp_path / name) for name in ("alone", "by_dds"))
    assert {"/scan_info", "/tracking_error", "/model_residual", "/drive_voltage"} < one.keys()
    assert one.keys() == other.keys()
    del one["/monitor"], other["/monitor"]  # of which viewers need not get everything
    assert one == other


@pytest.mark.evidence
def test_figures_of_lines_that_come_after_the_end_are_recorded(alone: Path, tmp_path: Path) -> None:
    spec = tmp_path / "scan.yaml"
    spec.write_text(SPEC, "utf-8")
    words = ["scan", "--spec", spec, "--bag", tmp_path / "late"]
    done = afm_scan(alone, *words, before=LATE)
    assert done.returncode == 0, done.stderr
    assert len(sent(tmp_path / "late")["/tracking_error"]) == 4


@pytest.mark.evidence
def test_a_record_is_the_same_to_the_bit(alone: Path, tmp_path: Path) -> None:
    """As is a record by DDS: see test_calibrate."""
    done = afm_scan(alone, "calibrate", "--experiment", "rest", "--out", tmp_path / "alone")
    assert (done.returncode, done.stderr.count("\n")) == (0, 1), done.stderr
    bag = read_scan(tmp_path / "alone/rest")
    expected = drive_through(EXPERIMENTS["rest"].plan(), default_plant(), seed=1)
    for name, signal in zip(("drive_voltage", "achieved_displacement"), expected, strict=True):
        for axis in AXES:
            np.testing.assert_array_equal(bag.whole(name).axis(axis), signal.axis(axis))
    assert "true_displacement" in bag.topics


def test_what_is_refused_is_one_more_line(alone: Path, tmp_path: Path) -> None:
    spec = tmp_path / "scan.yaml"
    spec.write_text(SPEC.replace("{", "{range_x_um: 140.0, "), "utf-8")
    done = afm_scan(alone, "scan", "--spec", spec, "--bag", tmp_path / "bag")
    assert done.returncode == 3
    _, message = done.stderr.splitlines()
    assert message.startswith("afm-scan: inversion_compensator: sample ")
    assert not (tmp_path / "bag").exists()


def test_a_node_alone_is_refused(alone: Path) -> None:
    done = afm_scan(alone, "run", "scan_recorder")
    assert done.returncode == 2
    assert "install ROS 2, or cyclonedds" in done.stderr
    assert done.stderr.count("\n") == 1


@pytest.mark.evidence
def test_the_demonstration_runs(alone: Path, tmp_path: Path) -> None:
    done = afm_scan(alone, "demo", "--out", tmp_path / "demo", before=SMALL_DEMO)
    assert done.returncode == 0, done.stderr
    assert done.stderr.count(ONE_PROCESS) == 1
    assert (tmp_path / "demo/report.html").is_file()


@pytest.mark.evidence
def test_the_loop_is_closed(alone: Path, tmp_path: Path) -> None:
    spec = tmp_path / "scan.yaml"
    spec.write_text(SPEC, "utf-8")
    words = ["close-loop", "--spec", spec, "--out", tmp_path / "out", "--rounds", "1"]
    done = afm_scan(alone, *words, before=ONE_ENTRY)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "out/diagnosis.json").is_file()
