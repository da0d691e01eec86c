"""Drives out and records in by files: a lab's own program moves the scanner."""

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import click
import numpy as np
import pytest
from click.testing import CliRunner

from afm_scan_ros.bag.reader import read_scan
from afm_scan_ros.cli.calibrate import calibrate
from afm_scan_ros.cli.close_loop import close_loop
from afm_scan_ros.cli.driving import DrivenScanner
from afm_scan_ros.cli.options import CONFIG
from afm_scan_ros.cli.scan import scan
from afm_scan_ros.cli.scanner import driver_and_file
from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.identification.drives.experiments import EXPERIMENTS, resized
from afm_scan_ros.core.types import Trace
from afm_scan_ros.drivers import load_settings
from afm_scan_ros.drivers.files import FileExchange
from afm_scan_ros.features.learning.learn_command import learn
from helpers import in_process
from helpers.in_process import default_plant, drive_through
from helpers.lab import METRES_PER_VOLT

ROOT = Path(__file__).parents[2]
SENSOR = (
    f"{{sensor_scale_m_per_v: {METRES_PER_VOLT!r}, sensor_offset_v: 0.0, sensor_low_v: -10.0,"
    " sensor_high_v: 10.0}"
)
SETTINGS = f"""\
amplifier: {{voltage_limit_v: 5.0, slew_limit_v_per_s: 2.0e5, ramp_down_slew_v_per_s: 40.0}}
x: {SENSOR}
y: {SENSOR}
sampling_instant: before_update
latency_samples: 0
response_time_s: 0.005
drive_resolution_v: 0.1
options: {{folder: exchange, timeout_s: 120.0}}
"""
SPEC = """\
/**/trajectory_generator:
  ros__parameters: {range_x_um: 10.0, range_y_um: 10.0, lines: 4, samples_per_line: 500}
"""
MODEL = ["--model", str(CONFIG / "model.yaml")]
PERIOD = 1e-3
HEADING = "time_s,sensor_x_v,sensor_y_v\n"


@pytest.fixture(autouse=True)
def _here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("stage.yaml").write_text(SETTINGS, "utf-8")
    Path("scan.yaml").write_text(SPEC, "utf-8")


@pytest.fixture
def _lab() -> Iterator[None]:
    """Run the lab's program."""
    Path("exchange").mkdir()
    paths = os.pathsep.join([str(ROOT), str(ROOT / "test"), os.environ.get("PYTHONPATH", "")])
    program = subprocess.Popen(
        [sys.executable, "-m", "helpers.lab", "exchange"],
        env={**os.environ, "PYTHONPATH": paths},
    )
    yield
    assert program.poll() is None
    program.kill()
    program.wait()


def same(one: Trace, other: Trace) -> None:
    np.testing.assert_array_equal(one.x, other.x)
    np.testing.assert_array_equal(one.y, other.y)


@pytest.mark.evidence
@pytest.mark.usefixtures("_lab")
def test_the_record_is_that_of_the_scanner_itself() -> None:
    size = ["--experiment", "broadband", "--amplitude", "1V", "--duration", "0.3s"]
    words = ["--scanner", "files:stage.yaml", *size, "--out", "bags"]
    done = CliRunner().invoke(calibrate, words)
    assert done.exit_code == 0, done.output
    plan = resized(EXPERIMENTS["broadband"].plan(), 1.0, 0.3)
    drive, displacement = drive_through(plan, default_plant(), seed=1)
    recording = read_scan(Path("bags/broadband"))
    assert recording.info.pattern == "broadband"
    same(recording.whole("drive_voltage"), drive)
    same(recording.whole("achieved_displacement"), displacement)


@pytest.mark.usefixtures("_lab")
def test_the_scan_is_that_of_the_scanner_itself() -> None:
    words = ["--scanner", "files:stage.yaml", *MODEL, "--spec", "scan.yaml", "--bag", "own"]
    done = CliRunner().invoke(scan, words)
    assert done.exit_code == 0, done.output
    recording = read_scan(Path("own"))
    assert recording.info.spec is not None
    alone = in_process.scan(recording.info.spec, in_process.ALL)
    same(recording.whole("desired_displacement"), alone.desired)
    same(recording.whole("drive_voltage"), alone.drive)
    same(recording.whole("achieved_displacement"), alone.measured)


@pytest.mark.evidence
@pytest.mark.usefixtures("_lab")
def test_a_scan_is_learned_by_files() -> None:
    Path("scan.yaml").write_text(SPEC.replace("500", "2000"), "utf-8")
    words = ["--scanner", "files:stage.yaml", *MODEL, "--spec", "scan.yaml", "--out", "learned"]
    done = CliRunner().invoke(learn, [*words, "--scans", "3"])
    assert done.exit_code == 0, done.output
    found = json.loads(Path("learned/learning.json").read_text("utf-8"))
    errors = [scan["tracking"]["measured"]["x"]["all"]["rms_m"] for scan in found["scans"]]
    assert errors[-1] < 0.5 * errors[0]


def test_the_limits_of_a_scanner_by_files_are_those_of_its_settings() -> None:
    limits = DrivenScanner("files:stage.yaml").limits
    assert limits is not None
    assert (limits.voltage, limits.slew) == (5.0, 2e5)
    with pytest.raises(InputError, match=r"files:stage\.yaml: no node exchanges files: give it to"):
        driver_and_file("files:stage.yaml")


def exchanged(record: str, *, latency: int = 0, timeout: float = 60.0, end: float = 0.0) -> Trace:
    """Exchange a drive of a second, from 2 V to an end, for a record that is there as it is."""
    settings = SETTINGS.replace("latency_samples: 0", f"latency_samples: {latency}")
    Path("stage.yaml").write_text(settings.replace("120.0", f"{timeout}"), "utf-8")
    drive = Trace(0, PERIOD, np.linspace(2.0, end, 1000), np.zeros(1000))
    exchange = FileExchange(load_settings("files", Path("stage.yaml")))

    def answer(_: str) -> None:
        if record and not (path := Path("exchange/rest.measured.csv")).exists():
            path.write_text(HEADING + record, "utf-8")

    return exchange.displacement("rest", drive, answer)


def rows(count: int, period: float = PERIOD, low: float = 0.0) -> str:
    read = np.linspace(low, 1.0, count)
    return "".join(f"{period * k:.9g},{v:.9g},{0.1 * v:.9g}\n" for k, v in enumerate(read))


def test_late_readings_have_the_sample_of_their_displacement() -> None:
    moved = exchanged(rows(1007), latency=7)
    expected = METRES_PER_VOLT * np.linspace(0.0, 1.0, 1007)[7:]
    np.testing.assert_allclose(moved.x, expected, rtol=1e-8)
    assert len(np.loadtxt("exchange/rest.csv", delimiter=",", skiprows=1)) == 1007


def test_what_is_put_out_ends_at_rest_and_the_ramp_is_no_part_of_the_record() -> None:
    """Half a cosine from 1 V at 40 V/s takes 40 samples, after two in which readings come late."""
    moved = exchanged(rows(1042), latency=2, end=1.0)
    expected = METRES_PER_VOLT * np.linspace(0.0, 1.0, 1042)[2:1002]
    np.testing.assert_allclose(moved.x, expected, rtol=1e-8)
    output = np.loadtxt("exchange/rest.csv", delimiter=",", skiprows=1)[:, 1]
    assert output[999:1002].tolist() == [1.0] * 3
    assert output[-1] == pytest.approx(0.0, abs=1e-15)
    assert np.all(np.diff(output[1001:]) < 0.0)
    assert np.abs(np.diff(output[1001:])).max() <= 40.0 * PERIOD


@pytest.mark.parametrize(
    ("record", "error", "said"),
    [
        (rows(999), InputError, "measured.csv: 999 samples, but the drive has 1000"),
        (rows(1000, 2e-3), InputError, "500 samples a second, but the drive has 1000"),
        (rows(1000, low=-11.0), ScanError, "sample 0, axis x: the sensor reads -11 V, which is"),
        (rows(1000).replace("0.002,", "0.0025,"), InputError, "measured.csv"),
        ("", ScanError, r"measured.csv has not come within 0\.5 s"),
    ],
    ids=["short", "slow", "clipped", "uneven", "none"],
)
def test_a_record_that_does_not_fit_is_refused(
    record: str, error: type[Exception], said: str
) -> None:
    with pytest.raises(error, match=said):
        exchanged(record, timeout=60.0 if record else 0.5)


def test_an_earlier_exchange_is_not_taken_for_this_one() -> None:
    Path("exchange").mkdir()
    Path("exchange/rest.measured.csv").write_text(rows(1000), "utf-8")
    with pytest.raises(InputError, match=r"rest\.measured\.csv exists already: remove it"):
        exchanged("")


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ("{}", "stage.yaml: options: key 'folder' is missing; add it"),
        ("{folder: a, timeout_s: 0.0}", "stage.yaml: options: timeout_s = 0.0 is out of range"),
    ],
)
def test_wrong_options_of_an_exchange_are_refused(options: str, said: str) -> None:
    text = SETTINGS[: SETTINGS.index("options:")] + f"options: {options}\n"
    Path("stage.yaml").write_text(text, "utf-8")
    with pytest.raises(InputError, match=said):
        FileExchange(load_settings("files", Path("stage.yaml")))


@pytest.mark.parametrize("command", [scan, learn, close_loop])
@pytest.mark.parametrize("scanner", ["mylab:Stage:none.yaml", "files:none.yaml", "external"])
def test_a_real_scanner_without_its_own_model_is_refused(
    command: click.Command, scanner: str
) -> None:
    end = ["--bag", "none"] if command is scan else ["--out", "none"]
    done = CliRunner().invoke(command, ["--scanner", scanner, *end])
    assert isinstance(done.exception, InputError)
    said = str(done.exception)
    assert f"--scanner {scanner}: give this scanner's model by --model FILE" in said
    assert said.endswith(f"on purpose, give --model {CONFIG / 'model.yaml'}")
    assert not Path("none").exists()


@pytest.mark.parametrize("scanner", ["files", "nidaqmx", "mylab:Stage"])
def test_all_that_a_scanner_lacks_is_named_at_once(scanner: str) -> None:
    done = CliRunner().invoke(scan, ["--scanner", scanner, "--bag", "none"])
    settings = f"--scanner {scanner}: give its settings, as --scanner {scanner}:stage.yaml"
    assert str(done.exception).startswith(f"{settings}; give this scanner's model by --model FILE")
    done = CliRunner().invoke(scan, ["--scanner", scanner, *MODEL, "--bag", "none"])
    assert str(done.exception) == settings


@pytest.mark.parametrize("scanner", ["", "stage", "mylab:"])
def test_a_scanner_of_no_form_is_refused_with_the_forms(scanner: str) -> None:
    done = CliRunner().invoke(scan, ["--scanner", scanner, "--bag", "none"])
    assert str(done.exception).startswith(f"--scanner {scanner!r}: give sim, external, files:FILE")


@pytest.mark.parametrize(
    ("scanner", "given"), [("mylab:Stage:none.yaml", MODEL), ("simulated:none.yaml", [])]
)
def test_the_simulated_scanners_model_serves_on_purpose(scanner: str, given: list[str]) -> None:
    done = CliRunner().invoke(scan, ["--scanner", scanner, *given, "--bag", "none"])
    assert "none.yaml: no such file" in str(done.exception)
