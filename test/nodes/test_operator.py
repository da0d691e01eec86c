"""An operator starts a scanner's node in a loop, and stops a record at any moment."""

import json
import os
import shlex
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from afm_scan_ros.bag.reader import read_scan
from afm_scan_ros.cli.driving import DrivenScanner, run_calibration
from afm_scan_ros.core.identification.drives.excitation import Plan
from afm_scan_ros.core.identification.drives.experiments import EXPERIMENTS, resized
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.types import AXES
from afm_scan_ros.features.learning.learn_command import learn
from afm_scan_ros.files import share_directory
from afm_scan_ros.files.plant_file import save_scan
from helpers.in_process import default_plant, drive_through
from helpers.stage import stage

pytestmark = pytest.mark.long

PATIENCE = 60.0
AFM_SCAN = [sys.executable, "-c", "from afm_scan_ros.cli.main import main; main()"]


@pytest.fixture
def settings(tmp_path: Path) -> Path:
    return stage(tmp_path / "stage.yaml", output_log=str(tmp_path / "outputs.txt"))


@pytest.fixture
def _in_a_loop(settings: Path) -> Iterator[None]:
    """Start the node anew after each scan, as the tutorial does."""
    words = [f"settings_file:={settings}", "driver:=simulated", "real_time:=false"]
    given = [word for each in (*words, "liveness_timeout_s:=30.0") for word in ("-p", each)]
    node = shlex.join([*AFM_SCAN, "run", "scanner_driver", "--ros-args", *given])
    loop = subprocess.Popen(["/bin/sh", "-c", f"while {node}; do :; done"], start_new_session=True)
    yield
    os.killpg(loop.pid, signal.SIGTERM)
    loop.wait()


@pytest.mark.evidence
@pytest.mark.usefixtures("_in_a_loop")
def test_one_record_after_another_comes_from_a_node_in_a_loop(tmp_path: Path) -> None:
    plans = [small("broadband"), small("one_axis")]
    run_calibration(DrivenScanner("external", time_scale=0.0), tmp_path / "out", plans)
    for plan in plans:
        recording = read_scan(tmp_path / "out" / plan.name)
        drive, moved = drive_through(plan, default_plant(), seed=1)
        np.testing.assert_array_equal(recording.whole("drive_voltage").x, drive.x)
        np.testing.assert_array_equal(recording.whole("achieved_displacement").x, moved.x)


@pytest.mark.evidence
@pytest.mark.usefixtures("_in_a_loop")
def test_a_scan_is_learned_from_a_node_in_a_loop(tmp_path: Path) -> None:
    spec = ScanSpec(range_x=10e-6, range_y=10e-6, line_rate=10.0, lines=8, samples_per_line=2000)
    save_scan(tmp_path / "scan.yaml", spec, "A scan.")
    words = ["--scanner", "external", "--spec", str(tmp_path / "scan.yaml"), "--time-scale", "0"]
    words += ["--model", str(share_directory() / "config/model.yaml")]
    done = CliRunner().invoke(learn, [*words, "--scans", "3", "--out", str(tmp_path / "out")])
    assert done.exit_code == 0, done.output
    found = json.loads((tmp_path / "out/learning.json").read_text("utf-8"))
    for axis in AXES:
        errors = [scan["tracking"]["measured"][axis]["all"]["rms_m"] for scan in found["scans"]]
        assert errors[-1] < 0.5 * errors[0]


def small(name: str) -> Plan:
    return resized(EXPERIMENTS[name].plan(), 0.2, 2.0)


def test_ctrl_c_ramps_down_and_keeps_what_was_recorded(tmp_path: Path, settings: Path) -> None:
    words = ["--scanner", f"simulated:{settings}", "--experiment", "stepped_sine"]
    size = ["--amplitude", "1V", "--duration", "60s", "--time-scale", "1"]
    command = subprocess.Popen(
        [*AFM_SCAN, "calibrate", *words, *size, "--out", str(tmp_path / "out")],
        stderr=subprocess.PIPE,
        text=True,
    )
    log, deadline = tmp_path / "outputs.txt", time.monotonic() + PATIENCE
    while time.monotonic() < deadline and not moving(log):
        time.sleep(0.1)
    command.send_signal(signal.SIGINT)
    _, said = command.communicate(timeout=PATIENCE)
    assert command.returncode == 130
    kept = tmp_path / "out/stepped_sine.failed"
    assert said.rstrip().endswith(f"afm-scan: interrupted; what was recorded is in {kept}")
    outputs = np.loadtxt(log, ndmin=2)
    assert np.any(outputs[:, 2:]), said
    assert not np.any(outputs[-1, 2:])
    drive = read_scan(kept).whole("drive_voltage")
    assert 0 < drive.x.size < 60.0 / drive.sample_period


def moving(log: Path) -> bool:
    """Whether the outputs have left rest."""
    lines = log.read_text("utf-8").splitlines() if log.exists() else []
    return any(float(volts) for line in lines[:-1] for volts in line.split()[2:])
