"""Without ROS the commands scan in this process; whatever ends a scan, outputs come to rest."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from importlib.machinery import ModuleSpec
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from afm_scan_ros.bag.mcap_file import messages
from afm_scan_ros.bag.reader import read_scan
from afm_scan_ros.bag.writer import FileWriter
from afm_scan_ros.cli import execution
from afm_scan_ros.cli.driving import DrivenScanner, run_calibration
from afm_scan_ros.cli.main import run
from afm_scan_ros.cli.options import CONFIG
from afm_scan_ros.cli.orders import ScanFiles
from afm_scan_ros.cli.scan import run_scan
from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.identification.drives.experiments import EXPERIMENTS
from afm_scan_ros.core.model import INVERSES
from afm_scan_ros.core.types import AXES
from afm_scan_ros.files import yaml
from afm_scan_ros.simulation.scanner import Piezoscanner
from helpers.in_process import default_plant, drive_through
from helpers.stage import stage

SPEC = """\
/**/trajectory_generator:
  ros__parameters: {range_x_um: 10.0, range_y_um: 10.0, line_rate_hz: 20.0, lines: 6,
    samples_per_line: 1000, preparation_cycles: 5, block_size: 500}
"""
VOLTS = {"sensor_scale_m_per_v": -8e-6, "sensor_offset_v": 0.25, "sensor_low_v": -10.0}
PATIENCE = 60.0
MAIN = "from afm_scan_ros.cli.main import main; main()"


@pytest.fixture(autouse=True)
def found(monkeypatch: pytest.MonkeyPatch) -> Iterator[set[str]]:
    """Hide ROS; return the names of modules that are to be found nevertheless."""
    names: set[str] = set()
    monkeypatch.setattr(
        "afm_scan_ros.nodes.find_spec",
        lambda name: ModuleSpec(name, None) if name in names else None,
    )
    execution.nodes_can_run.cache_clear()
    yield names
    execution.nodes_can_run.cache_clear()


def test_a_report_says_what_executed_its_scans(found: set[str]) -> None:
    driver = "and the scanner's driver in another"
    assert execution.how_scans_run() == f"without ROS 2, as a pipeline in one process {driver}"
    found |= {"rclpy", "afm_scan_ros.msg"}
    execution.nodes_can_run.cache_clear()
    assert execution.how_scans_run() == f"by nodes of ROS 2, a process each, {driver}"


@pytest.fixture
def spec(tmp_path: Path) -> Path:
    path = tmp_path / "scan.yaml"
    path.write_text(SPEC, "utf-8")
    return path


@pytest.fixture
def faulty(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., str]:
    """Return a function that gives the option --scanner of a driver with a fault."""
    folder = Path(__file__).parents[1] / "drivers"
    monkeypatch.setenv("PYTHONPATH", str(folder), prepend=os.pathsep)

    def option(driver: str, high: float = 10.0, latency: int = 0, **options: object) -> str:
        path = stage(tmp_path / "stage.yaml", output_log=str(tmp_path / "outputs.txt"), **options)
        axis = {**VOLTS, "sensor_high_v": high}
        timing = {"latency_samples": latency, "response_time_s": 0.005, "drive_resolution_v": 0.1}
        yaml.save(path, {**yaml.load(path), "x": axis, "y": axis, **timing}, "A faulty scanner.")
        return f"faulty:{driver}:{path}"

    return option


def files(spec: Path, scanner: str = "sim", plant: Path = CONFIG / "plant.yaml") -> ScanFiles:
    return ScanFiles(spec, CONFIG / "model.yaml", plant, spec.parent / "bag", scanner)


def outputs(folder: Path) -> np.ndarray:
    return np.loadtxt(folder / "outputs.txt", ndmin=2)


def moved_to_rest(folder: Path) -> bool:
    driven = outputs(folder)
    return bool(np.any(driven[:, 2:]) and not np.any(driven[-1, 2:]))


def test_a_record_is_that_of_the_simulation(tmp_path: Path) -> None:
    plan = EXPERIMENTS["rest"].plan()
    run_calibration(DrivenScanner(), tmp_path, [plan])
    bag = read_scan(tmp_path / "rest")
    expected = drive_through(plan, default_plant(), seed=1)
    for name, trace in zip(("drive_voltage", "achieved_displacement"), expected, strict=True):
        for axis in AXES:
            np.testing.assert_array_equal(bag.whole(name).axis(axis), trace.axis(axis))
    assert "true_displacement" in bag.topics


def test_a_watched_scan_tells_its_alarm_once_and_records_each_line(
    spec: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    run_scan(files(spec, plant=CONFIG / "plants/delay_large.yaml"), INVERSES, watched=True)
    said = [s for s in capfd.readouterr().err.splitlines() if s.startswith("residual_monitor: ")]
    assert len(said) == 1
    assert said[0].endswith("Diagnose this scan's bag")
    topics = [message.topic for message in messages(spec.parent / "bag/bag_0.mcap")]
    assert (topics.count("/model_residual"), topics.count("/tracking_error")) == (6, 6)
    assert topics.count("/monitor") > 100
    assert read_scan(spec.parent / "bag").warnings == ()


def test_a_scan_beyond_the_range_is_refused_before_it_moves(spec: Path) -> None:
    spec.write_text(SPEC.replace("range_x_um: 10.0", "range_x_um: 140.0"), "utf-8")
    with pytest.raises(ScanError, match=r"^inversion_compensator: sample .*; the largest range of"):
        run_scan(files(spec), INVERSES)
    assert not (spec.parent / "bag").exists()


def test_a_wrong_flow_is_refused(spec: Path) -> None:
    spec.write_text(SPEC.replace("500}", "20000}"), "utf-8")
    with pytest.raises(InputError, match=r"scan.yaml: block_size = 20000 is above 10000"):
        run_scan(files(spec), INVERSES)


def test_what_needs_ros_says_so_in_one_line() -> None:
    done = CliRunner().invoke(run, ["scan_recorder"])
    assert str(done.exception).startswith("run: ROS 2 is not installed")
    assert isinstance(done.exception, InputError)
    with pytest.raises(InputError, match="--scanner external: ROS 2 is not installed"):
        DrivenScanner("external").record(EXPERIMENTS["rest"].plan(), Path("unused"), "rest")


def test_ros_without_messages_is_told_once(
    spec: Path, found: set[str], capfd: pytest.CaptureFixture[str]
) -> None:
    found.add("rclpy")
    run_scan(files(spec), ("none",))
    said = capfd.readouterr().err
    assert said.count("the messages of afm_scan_ros are not built") == 1
    assert len(said.strip().splitlines()) == 1  # rich 13.7 adds an empty one
    assert read_scan(spec.parent / "bag").warnings == ()


RAMPED = r"; drive ramped down to 0 V within [\d.]+(e-\d+)? s"
FAULTS = [
    ("LostCable", rf"axis x: the sensor has read exactly 0\.25 V while .*{RAMPED}"),
    ("NotANumber", rf"axis x: the sensor reads nan V; the sensor is lost.*{RAMPED}"),
    ("Clipped", rf"axis [xy]: the sensor reads 0\.35 V, which is clipped.*{RAMPED}"),
    ("Underrun", rf"underrun: a sample was not output in time{RAMPED}"),
    ("Broken", rf"ZeroDivisionError: injected \(faulty.py, line \d+\){RAMPED}"),
]


@pytest.mark.parametrize(("driver", "said"), FAULTS, ids=[name for name, _ in FAULTS])
def test_a_fault_ends_the_scan_by_name_with_outputs_at_rest(
    spec: Path, faulty: Callable[..., str], driver: str, said: str
) -> None:
    scanner = faulty(driver, high=0.35 if driver == "Clipped" else 10.0)
    with pytest.raises(ScanError, match=rf"^scanner_driver: .*{said}; what was") as raised:
        run_scan(files(spec, scanner), ("none",), 0.0)
    assert moved_to_rest(spec.parent)
    aside = spec.parent / "bag.failed"
    log = aside / "traceback.log"
    assert log.exists() == (str(log) in str(raised.value)) == (driver == "Broken")
    if log.exists():
        assert 'raise ZeroDivisionError("injected")' in log.read_text("utf-8")
    assert len(read_scan(aside).whole("drive_voltage").x)


ENDS = [
    ("Stopped", 0.0, "the driver's process was killed by SIGKILL; the drive may not be at rest"),
    ("NeverAtRest", 0.0, "the drive may not be at rest"),
    (
        "Hanging",
        1.0,
        r"(has not answered for|a call of the driver did not).*; the drive may not be",
    ),
]


@pytest.mark.parametrize(("driver", "pace", "said"), ENDS, ids=[name for name, *_ in ENDS])
def test_a_drive_that_may_be_up_is_told(
    spec: Path, faulty: Callable[..., str], driver: str, pace: float, said: str
) -> None:
    scanner = faulty(driver, **({"call": "advance"} if driver == "Hanging" else {}))
    if driver != "Stopped":
        path = scanner.rpartition(":")[2]
        metres = yaml.load(Path(path))["x"] | {"sensor_scale_m_per_v": 1.0, "sensor_offset_v": 0.0}
        yaml.save(Path(path), {**yaml.load(Path(path)), "x": metres, "y": metres}, "Metres.")
    with pytest.raises(ScanError, match=rf"^scanner_driver: .*{said}"):
        run_scan(files(spec, scanner), ("none",), pace)


def test_late_readings_are_dated_back(spec: Path, faulty: Callable[..., str]) -> None:
    run_scan(files(spec, faulty("Late", latency=7)), ("none",), 0.0)
    bag = read_scan(spec.parent / "bag")
    assert bag.warnings == ()
    drive, measured = (bag.whole(n) for n in ("drive_voltage", "achieved_displacement"))
    alone, _ = Piezoscanner(default_plant(), drive.sample_period, seed=1).advance(drive)
    for axis in AXES:
        np.testing.assert_allclose(measured.axis(axis), alone.axis(axis), rtol=1e-12, atol=1e-18)


def test_readings_that_never_come_are_told(spec: Path, faulty: Callable[..., str]) -> None:
    scanner, hasty = faulty("Real", latency=2000), {"feedback_latency_ms": 0.0}
    said = r"^inversion_compensator: the next line waits for .* which scanner_driver has not read"
    with pytest.raises(ScanError, match=rf"{said}.*{RAMPED}"):
        run_scan(
            files(spec, scanner),
            ("none",),
            0.0,
            {"inversion_compensator": hasty},
            line_feedback=True,
        )
    assert moved_to_rest(spec.parent)


def test_a_full_disk_ends_the_scan_at_rest(
    spec: Path, faulty: Callable[..., str], monkeypatch: pytest.MonkeyPatch
) -> None:
    whole, flushed = FileWriter.flush, []

    def flush(writer: FileWriter) -> None:
        flushed.append(writer)
        if len(flushed) > 1:
            raise OSError(28, "No space left on device")
        whole(writer)

    monkeypatch.setattr(FileWriter, "flush", flush)
    monkeypatch.setattr("afm_scan_ros.bag.writer.CHUNK_BYTES", 20_000)
    with pytest.raises(ScanError, match=rf"^scan_recorder: .*No space left.*{RAMPED}"):
        run_scan(files(spec, faulty("Real")), ("none",), 0.0)
    assert moved_to_rest(spec.parent)


@pytest.fixture
def scanning(spec: Path, tmp_path: Path) -> Iterator["subprocess.Popen[str]"]:
    """Start a scan of minutes without waiting, and wait until the outputs have moved."""
    spec.write_text(SPEC.replace("lines: 6", "lines: 4000"), "utf-8")
    settings = stage(tmp_path / "stage.yaml", output_log=str(tmp_path / "outputs.txt"))
    words = ["scan", "--scanner", f"simulated:{settings}", "--time-scale", "0", "--spec", str(spec)]
    words += ["--model", str(CONFIG / "model.yaml"), "--bag", str(tmp_path / "bag")]
    words += ["--inverses", "none"]
    process = subprocess.Popen(
        [sys.executable, "-c", MAIN, *words],
        stderr=subprocess.PIPE,
        text=True,
    )
    log, deadline = tmp_path / "outputs.txt", time.monotonic() + PATIENCE
    while not (log.exists() and log.read_text("utf-8").count("\n") > 5):
        assert process.poll() is None
        assert time.monotonic() < deadline
        time.sleep(0.01)
    yield process
    process.kill()
    process.communicate()


@pytest.mark.skipif("not __import__('afm_scan_ros.nodes').nodes.lacking_ros()")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupted_scan_is_at_rest_and_can_be_read(
    scanning: "subprocess.Popen[str]", tmp_path: Path, number: int
) -> None:
    scanning.send_signal(number)
    _, said = scanning.communicate(timeout=PATIENCE)
    kept = tmp_path / "bag.failed"
    last = f"afm-scan: interrupted; what was recorded is in {kept}"
    assert (scanning.returncode, said.splitlines()[-1]) == (130, last)
    assert moved_to_rest(tmp_path)
    assert len(read_scan(kept).whole("achieved_displacement").x) > 1000


@pytest.mark.skipif("not __import__('afm_scan_ros.nodes').nodes.lacking_ros()")
def test_a_killed_scan_comes_to_rest(scanning: "subprocess.Popen[str]", tmp_path: Path) -> None:
    scanning.kill()
    scanning.wait(PATIENCE)
    deadline = time.monotonic() + PATIENCE
    while not moved_to_rest(tmp_path):
        assert time.monotonic() < deadline
        time.sleep(0.05)
