"""``afm-scan calibrate`` by a plan for the scanner, its records made in this process."""

import json
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from attrs import define, evolve, field
from click import UsageError
from click.testing import CliRunner, Result

from afm_scan_ros.bag.reader import read_scan
from afm_scan_ros.bag.writer import write_record
from afm_scan_ros.cli import calibrate as command
from afm_scan_ros.cli.driving import DrivenScanner
from afm_scan_ros.cli.main import cli
from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.identification.drives.excitation import Plan
from afm_scan_ros.core.scan_info import ScanInfo
from afm_scan_ros.core.types import Trace
from afm_scan_ros.files import share_directory
from afm_scan_ros.report.analysis import analyse
from helpers.in_process import default_plant, drive_through

SMALL = ["--range", "40um", "--rate", "2.5kHz", "--hold", "10s"]
"""Of the default plant, sampled as slowly as its resonance allows."""
MODEL = ["--model", str(share_directory() / "config/model.yaml")]
SCAN = """\
/**/trajectory_generator:
  ros__parameters: {range_x_um: 20.0, range_y_um: 20.0, line_rate_hz: 20.0, lines: 4,
    samples_per_line: 1000}
"""
MIDDLE = SCAN.replace(
    "range_x_um: 20.0, range_y_um: 20.0",
    """\
range_x_um: 8.0, range_y_um: 8.0,
    centre_x_um: 10.0, centre_y_um: 10.0""",
)
SETTINGS = """\
amplifier: {voltage_limit_v: 3.0, slew_limit_v_per_s: 20.0, ramp_down_slew_v_per_s: 20.0}
x: {sensor_scale_m_per_v: 1.0, sensor_offset_v: 0.0, sensor_low_v: -1.0, sensor_high_v: 1.0}
y: {sensor_scale_m_per_v: 1.0, sensor_offset_v: 0.0, sensor_low_v: -1.0, sensor_high_v: 1.0}
latency_samples: 0
response_time_s: 0.005
drive_resolution_v: 0.1
sampling_instant: before_update
"""


@define
class InProcess:
    """Drives the default plant in this process; ``stops`` at a title, its record half done."""

    stops: str = "never"
    gain: float = 1.0
    plans: list[Plan] = field(factory=list)

    def record(self, plan: Plan, bag: Path, title: str) -> None:
        self.plans.append(plan)
        drive, moved = drive_through(plan, default_plant(), seed=1)
        moved = evolve(moved, x=self.gain * moved.x, y=self.gain * moved.y)
        done = plan.total_samples // 2 if self.stops in title else plan.total_samples
        info = ScanInfo("s", 0, plan.name, plan.sample_period, done)
        drive, moved = (Trace(0, t.sample_period, t.x[:done], t.y[:done]) for t in (drive, moved))
        write_record(bag, info, {"drive_voltage": drive, "achieved_displacement": moved})
        if self.stops in title:
            raise KeyboardInterrupt


def calibrate(scanner: InProcess, *words: str) -> Result:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(DrivenScanner, "record", lambda _, *given: scanner.record(*given))
        return CliRunner().invoke(command.calibrate, words, standalone_mode=False)


def peak_of(plan: Plan) -> float:
    return max(float(np.abs(wave).max()) for wave in (plan.x, plan.y))


def test_drives_grow_until_an_operator_stops_and_go_on_with_what_is_recorded(
    tmp_path: Path,
) -> None:
    words, out = [*SMALL, *MODEL], tmp_path / "a"
    scanner = InProcess(stops="hysteresis, 12")
    stopped = calibrate(scanner, *words, "--out", str(out))
    cut = out / "trials/hysteresis_0125.failed"
    said = f"interrupted; what was recorded is in {cut}"
    assert str(stopped.exception.__cause__) == said
    rows = json.loads((out / "growth.json").read_text("utf-8"))["rows"]
    assert [row["record"] for row in rows] == ["creep"]
    steps = [peak_of(plan) for plan in scanner.plans if plan.name == "creep"]
    assert len(steps) == 5
    assert [after / before for before, after in pairwise(steps)] == pytest.approx([2.0] * 4)
    lines = [line for line in stopped.output.splitlines() if line.startswith("creep, ")]
    assert len(lines) == len(steps)
    assert read_scan(out / "creep").info.pattern == "creep"
    for bag in (cut, out / "trials/hysteresis_0062"):
        assert read_scan(bag).whole("achieved_displacement").x.size > 0
    again = InProcess(stops="hysteresis, 6")
    calibrate(again, *words, "--have", str(out / "creep"), "--out", str(tmp_path / "b"))
    assert [plan.name for plan in again.plans] == ["hysteresis"]


def test_a_displacement_at_its_limit_keeps_a_drive_small(tmp_path: Path) -> None:
    words = [*SMALL, *MODEL, "--travel", "6um", "--out", str(tmp_path / "out")]
    done = calibrate(InProcess(stops="hysteresis", gain=2.0), *words)
    kept = [line for line in done.output.splitlines() if line.startswith("creep: recorded with")]
    assert len(kept) == 1
    assert " would move " in kept[0]
    assert kept[0].endswith("more than 6 µm.")
    moved = read_scan(tmp_path / "out/creep").whole("achieved_displacement")
    assert 5e-6 < max(np.ptp(moved.x), np.ptp(moved.y)) < 6.1e-6


def test_a_model_states_range_voltages_and_resonance(tmp_path: Path) -> None:
    scanner = InProcess(stops="creep, 6")
    words = [*MODEL, "--rate", "2.5kHz", "--hold", "10s", "--out", str(tmp_path / "out")]
    assert calibrate(scanner, *words).exit_code == 1
    assert [plan.name for plan in scanner.plans] == ["creep"]


def test_the_limits_of_a_driver_s_settings_hold(tmp_path: Path) -> None:
    (tmp_path / "stage.yaml").write_text(SETTINGS, "utf-8")
    scanner, driver = InProcess(stops="survey, 6"), f"simulated:{tmp_path / 'stage.yaml'}"
    words = ["--scanner", driver, *SMALL, "--out"]
    done = calibrate(scanner, *words, str(tmp_path / "out"))
    assert "survey: planned with" in done.output
    assert "beyond the amplifier's 20 V/s" in done.output
    (plan,) = scanner.plans
    for wave in (plan.x, plan.y):
        assert 16.0 * np.abs(wave).max() <= 3.0
        assert 16.0 * np.abs(np.diff(wave)).max() / plan.sample_period <= 20.0
    refused = calibrate(scanner, *words, str(tmp_path / "no"), "--limit", "4V")
    assert isinstance(refused.exception, InputError)
    assert "beyond the scanner's limit of 3 V" in str(refused.exception)


def test_an_axis_that_does_not_move_ends_the_calibration(tmp_path: Path) -> None:
    words = [*SMALL, *MODEL, "--out", str(tmp_path / "out")]
    done = calibrate(InProcess(gain=0.0), *words)
    assert isinstance(done.exception, ScanError)
    said = "axis x: the drive grew 2 times, and the displacement from 0 to 0 µm"
    assert said in str(done.exception)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ([], "the default drives fit the default simulated scanner alone"),
        (["--experiment", "rates"], "give --model, or --amplitude and --duration"),
        (["--range", "40um"], "--rate"),
        (["--range", "40um", "--rate", "5kHz"], "--limit"),
    ],
)
def test_what_a_real_scanner_lacks_is_asked_for(
    tmp_path: Path, words: list[str], said: str
) -> None:
    scanner = InProcess()
    done = calibrate(scanner, "--scanner", "external", *words, "--out", str(tmp_path / "out"))
    assert isinstance(done.exception, UsageError)
    assert said in done.exception.message
    assert not scanner.plans


@pytest.mark.evidence
@pytest.mark.parametrize("unipolar", [False, True])
def test_a_scan_as_large_as_the_calibration_was_for_is_compensated(
    tmp_path: Path, *, unipolar: bool
) -> None:
    """By the commands of the guide, of a scan file that states no preparation.

    A unipolar scanner scans about the middle of its travel, with an offset that records of unknown
    starts do not tell.
    """
    bags, model, scanned = tmp_path / "calibration", tmp_path / "model.yaml", tmp_path / "scanned"
    (spec := tmp_path / "scan.yaml").write_text(MIDDLE if unipolar else SCAN, "utf-8")
    drives = ["--range", "12um", "--lowest", "0V"] if unipolar else ["--range", "20um"]
    records = [bags / "survey", bags / "hysteresis", "--validation", bags / "validation"]
    for words in (
        ["calibrate", *drives, "--limit", "4V", "--rate", "20kHz", "--out", bags],
        ["identify", *records, "--out", model],
        ["scan", "--spec", spec, "--model", model, "--bag", scanned],
    ):
        done = CliRunner().invoke(cli, [str(word) for word in words])
        assert done.exit_code == 0, done.output
    true = analyse(read_scan(scanned)).true
    assert true is not None
    for axis in (true.x, true.y):
        assert axis.split is not None
        assert axis.constant_speed is not None
        assert axis.split.shape_share < 1e-3
        assert unipolar or axis.constant_speed.rms_share < 1e-3
