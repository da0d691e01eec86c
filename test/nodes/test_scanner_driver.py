"""A scanner moved by a driver: the same samples as in simulation, and faults that are named."""

import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from afm_scan_ros.bag.reader import read_scan
from afm_scan_ros.cli.calibrate import calibrate
from afm_scan_ros.cli.driving import DrivenScanner, run_calibration
from afm_scan_ros.cli.options import CONFIG
from afm_scan_ros.cli.orders import ScanFiles
from afm_scan_ros.cli.processes import NodeCommand, NodeProcess
from afm_scan_ros.cli.scan import run_scan, scan
from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.identification.drives.experiments import EXPERIMENTS, resized
from afm_scan_ros.core.types import Trace
from afm_scan_ros.simulation.scanner import Piezoscanner
from helpers.in_process import default_plant, drive_through
from helpers.ni_twin import settings_file, twin

pytestmark = pytest.mark.long

PATIENCE = 60.0
SETTINGS = """\
amplifier: {{voltage_limit_v: 5.0, slew_limit_v_per_s: 2.0e5, ramp_down_slew_v_per_s: 40.0}}
x: {sensor}
y: {sensor}
latency_samples: {latency}
response_time_s: 0.005
drive_resolution_v: 0.1
sampling_instant: before_update
options: {{output_log: {log}}}
"""
METRES = "{sensor_scale_m_per_v: 1.0, sensor_offset_v: 0.0, sensor_low_v: -1.0, sensor_high_v: 1.0}"
VOLTS = (
    "{sensor_scale_m_per_v: -8e-6, sensor_offset_v: 0.25, sensor_low_v: -10.0, sensor_high_v: 0.35}"
)
WIDE = VOLTS.replace("0.35", "10.0")


@pytest.fixture
def settings(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., str]:
    """Return a function that writes a settings file and returns its path."""
    faulty = Path(__file__).parents[1] / "drivers"
    monkeypatch.setenv("PYTHONPATH", str(faulty), prepend=os.pathsep)

    def write(sensor: str = METRES, latency: int = 0) -> str:
        path = tmp_path / "stage.yaml"
        log = tmp_path / "outputs.txt"
        path.write_text(SETTINGS.format(sensor=sensor, latency=latency, log=log), "utf-8")
        return str(path)

    return write


def files(spec: Path, bag: Path, scanner: str = "sim") -> ScanFiles:
    return ScanFiles(spec, CONFIG / "model.yaml", CONFIG / "plant.yaml", bag, scanner)


def signals(bag: Path, *names: str) -> list[Trace]:
    recording = read_scan(bag)
    assert recording.warnings == ()
    return [recording.whole(name) for name in names]


def same(one: Trace, other: Trace) -> None:
    np.testing.assert_array_equal(one.x, other.x)
    np.testing.assert_array_equal(one.y, other.y)


def test_a_scan_is_the_same_in_simulation_by_a_driver_and_in_one_process(
    spec: Path, tmp_path: Path, settings: Callable[..., str]
) -> None:
    run_scan(files(spec, tmp_path / "sim"), ("none",))
    run_scan(files(spec, tmp_path / "driver", f"simulated:{settings()}"), ("none",), 0.0)
    names = ("drive_voltage", "achieved_displacement")
    drive, measured = signals(tmp_path / "sim", *names)
    for one, other in zip((drive, measured), signals(tmp_path / "driver", *names), strict=True):
        same(one, other)
    alone = Piezoscanner(default_plant(), drive.sample_period, seed=1)
    same(measured, alone.advance(drive)[0])
    assert "true_displacement" not in read_scan(tmp_path / "driver").topics


def test_an_external_scanner_gives_the_same_record(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("afm_scan_ros.cli.scanner.PATIENCE", PATIENCE)
    unhurried = {"real_time": False, "liveness_timeout_s": 3.0}
    node = NodeProcess.start(NodeCommand("piezoscanner_sim", unhurried))
    try:
        words = ["--scanner", "external", "--experiment", "rest", "--time-scale", "0"]
        done = CliRunner().invoke(calibrate, [*words, "--out", str(tmp_path)])
        assert done.exit_code == 0, done.output
        assert "Recorded scanner external in" in done.output
        assert node.process.wait(PATIENCE) == 0
    finally:
        node.process.kill()
        node.process.wait()
        node.output.close()
    drive, displacement = drive_through(EXPERIMENTS["rest"].plan(), default_plant(), seed=1)
    for one, other in zip(
        signals(tmp_path / "rest", "drive_voltage", "achieved_displacement"),
        (drive, displacement),
        strict=True,
    ):
        same(one, other)
    assert "true_displacement" in read_scan(tmp_path / "rest").topics


def test_a_scan_is_the_same_by_ni_by_an_external_scanner_and_in_one_process(
    spec: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("nidaqmx")
    pytest.importorskip("grpc")
    monkeypatch.setattr("afm_scan_ros.cli.scanner.PATIENCE", PATIENCE)
    with twin(tmp_path) as server:
        stage = str(settings_file(tmp_path, server))
        run_scan(files(spec, tmp_path / "ni", f"nidaqmx:{stage}"), ("none",), 0.0)
        given = {"driver": "nidaqmx", "settings_file": stage, "real_time": False}
        node = NodeProcess.start(NodeCommand("scanner_driver", given | {"min_subscriptions": 2}))
        try:
            run_scan(files(spec, tmp_path / "external", "external"), ("none",), 0.0)
            assert node.process.wait(PATIENCE) == 0
        finally:
            node.process.kill()
            node.process.wait()
            node.output.close()
    names = ("drive_voltage", "achieved_displacement")
    drive, measured = signals(tmp_path / "ni", *names)
    for one, other in zip((drive, measured), signals(tmp_path / "external", *names), strict=True):
        same(one, other)
    alone = Piezoscanner(default_plant(), drive.sample_period, seed=1)
    same(measured, alone.advance(drive)[0])


def test_a_wait_for_no_scanner_ends(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("afm_scan_ros.cli.scanner.PATIENCE", 0.5)
    with pytest.raises(InputError, match=r"no scanner waits .* domain \d+: start scanner_driver"):
        run_calibration(DrivenScanner("external"), tmp_path, [EXPERIMENTS["rest"].plan()])


def test_late_volts_become_the_same_displacement(
    tmp_path: Path, settings: Callable[..., str]
) -> None:
    file = Path(settings(WIDE, latency=7))
    file.write_text(file.read_text("utf-8").replace("before_update", "after_update"), "utf-8")
    scanner = DrivenScanner(f"faulty:Late:{file}", time_scale=0.0)
    run_calibration(scanner, tmp_path, [resized(EXPERIMENTS["broadband"].plan(), 0.2, 2.0)])
    drive, measured = signals(tmp_path / "broadband", "drive_voltage", "achieved_displacement")
    alone, _ = Piezoscanner(default_plant(), drive.sample_period, seed=1).advance(drive)
    np.testing.assert_allclose(measured.x, alone.x, rtol=1e-12, atol=1e-18)
    np.testing.assert_allclose(measured.y, alone.y, rtol=1e-12, atol=1e-18)
    assert read_scan(tmp_path / "broadband").info.sampling_instant == "after_update"


@pytest.mark.parametrize(
    ("latency", "words", "said"),
    [
        (
            2501,
            "",
            r"latency_samples = 2501, with the .* is over half the scan's window of 5000: .* 5002",
        ),
        (0, "    trigger_offset_s: 1e-6\n", "samples are taken before_update, with an offset of 0"),
    ],
)
def test_a_scan_that_contradicts_the_settings_is_refused(
    spec: Path, tmp_path: Path, settings: Callable[..., str], latency: int, words: str, said: str
) -> None:
    spec.write_text(spec.read_text("utf-8") + words, "utf-8")
    given = {"driver": "simulated", "settings_file": settings(latency=latency)}
    node = NodeProcess.start(NodeCommand("scanner_driver", given))
    try:
        with pytest.raises(ScanError, match=rf"scanner_driver failed: .*stage.yaml: {said}"):
            run_scan(files(spec, tmp_path / "bag", "external"), ("none",), 0.0)
        assert node.process.wait(PATIENCE) == 2
    finally:
        node.process.kill()
        node.process.wait()
        node.output.close()


@pytest.fixture
def _at_rest(tmp_path: Path) -> Iterator[None]:
    """See that the outputs moved and came to rest."""
    yield
    outputs = np.loadtxt(tmp_path / "outputs.txt", ndmin=2)
    assert np.any(outputs[:, 2:])
    assert not np.any(outputs[-1, 2:])


FAULTS = [
    ("LostCable", r"axis x: the sensor has read exactly 0\.25 V while the drive moved by"),
    ("NotANumber", "axis x: the sensor reads nan V; the sensor is lost"),
    ("Clipped", r"axis [xy]: the sensor reads 0\.35 V, which is clipped at -10 or 0\.35 V"),
    ("Underrun", "underrun: a sample was not output in time"),
    ("Broken", "ZeroDivisionError: injected"),
]


@pytest.mark.usefixtures("_at_rest")
@pytest.mark.parametrize(("driver", "said"), FAULTS, ids=[name for name, _ in FAULTS])
def test_a_fault_ends_the_scan_by_name_with_outputs_at_rest(
    spec: Path, tmp_path: Path, settings: Callable[..., str], driver: str, said: str
) -> None:
    sensor = VOLTS if driver == "Clipped" else WIDE
    given = files(spec, tmp_path / "bag", f"faulty:{driver}:{settings(sensor)}")
    with pytest.raises(
        ScanError, match=rf"scanner_driver(:| failed:) .*{said}.*; drive ramped down to 0 V"
    ) as raised:
        run_scan(given, ("none",), 0.0)
    log = tmp_path / "bag.failed/traceback.log"
    assert log.exists() == (str(log) in str(raised.value)) == (driver == "Broken")
    if log.exists():
        written = log.read_text("utf-8")
        assert 'raise ZeroDivisionError("injected")' in written
        assert "faulty.py" in written


def test_a_driver_that_is_killed_is_named(
    spec: Path, tmp_path: Path, settings: Callable[..., str]
) -> None:
    scanner = f"faulty:Stopped:{settings(WIDE)}"
    said = "scanner_driver: the driver's process was killed by SIGKILL; the drive may not be at"
    with pytest.raises(ScanError, match=said):
        run_scan(files(spec, tmp_path / "bag", scanner), ("none",), 0.0)


def test_a_ramp_that_fails_after_a_whole_scan_is_named(
    spec: Path, tmp_path: Path, settings: Callable[..., str]
) -> None:
    scanner = f"faulty:NeverAtRest:{settings()}"
    with pytest.raises(ScanError, match=r"scanner_driver: .*the drive may not be at rest"):
        run_scan(files(spec, tmp_path / "bag", scanner), ("none",), 0.0)


def test_a_driver_that_hangs_is_named_and_ends_in_real_time(
    tmp_path: Path, settings: Callable[..., str]
) -> None:
    file = Path(settings())
    words = file.read_text("utf-8").replace("options: {", "options: {call: advance, ")
    file.write_text(words, "utf-8")
    scanner = f"faulty:Hanging:{file}"
    said = r"scanner_driver: .*(the driver has not answered for 0\.\d+ s|a call of the driver did)"
    with pytest.raises(ScanError, match=f"{said}.*; the drive may not be at rest"):
        run_calibration(DrivenScanner(scanner), tmp_path, [EXPERIMENTS["rest"].plan()])
    driver = int((tmp_path / "outputs.txt.pid").read_text("utf-8"))
    assert not Path(f"/proc/{driver}").exists()


def test_a_drive_beyond_the_settings_is_refused_before_it_moves(
    tmp_path: Path, settings: Callable[..., str]
) -> None:
    scanner = DrivenScanner(f"simulated:{settings()}")
    with pytest.raises(ScanError, match=r"sample \d+, axis \w: drive \[V\] = .* is beyond"):
        run_calibration(scanner, tmp_path, [resized(EXPERIMENTS["broadband"].plan(), 6.0, 2.0)])
    assert not (tmp_path / "outputs.txt").exists()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--scanner", "mylab"], "--scanner 'mylab': give sim, external, files:FILE, simulated"),
        (["--scanner", "simulated:nowhere.yaml"], "nowhere.yaml: no such file"),
    ],
)
def test_a_scanner_that_is_none_is_refused(tmp_path: Path, words: list[str], said: str) -> None:
    with pytest.raises(InputError, match=said):
        CliRunner().invoke(
            scan,
            [*words, "--model", str(CONFIG / "model.yaml"), "--bag", str(tmp_path / "bag")],
            catch_exceptions=False,
        )
    assert not list(tmp_path.iterdir())


def test_a_plant_belongs_to_the_simulation(tmp_path: Path) -> None:
    words = ["--scanner", "external", "--plant", "p.yaml", "--bag", str(tmp_path / "bag")]
    assert CliRunner().invoke(scan, words).exit_code == 2


def test_a_driver_that_is_none_is_refused_in_one_line(settings: Callable[..., str]) -> None:
    run = "import sys; from afm_scan_ros.nodes import start; sys.exit(start('scanner_driver'))"
    words = ["-p", "driver:=nowhere:Stage", "-p", f"settings_file:={settings()}"]
    done = subprocess.run(
        [sys.executable, "-c", run, "--ros-args", *words],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2
    last = done.stderr.strip().splitlines()[-1]
    assert last.startswith("scanner_driver: driver nowhere:Stage: No module named 'nowhere'; give")
    assert "Traceback" not in done.stderr
