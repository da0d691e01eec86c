"""What 'afm-scan identify' makes of three records of the simulated scanner."""

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from afm_scan_ros.bag.scan_info import ScanInfo
from afm_scan_ros.bag.scan_writer import ScanWriter
from afm_scan_ros.bench.scans import default_plant
from afm_scan_ros.cli.identify import identify
from afm_scan_ros.cli.in_process import record
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.excitation import Plan, hysteresis_plan
from afm_scan_ros.core.identification.multisine import Multisine
from afm_scan_ros.core.identification.recording import Recording
from afm_scan_ros.core.identification.sweeps import Chirp
from afm_scan_ros.core.identification.waypoints import Waypoints
from afm_scan_ros.files.model_file import load_model


def creep() -> Plan[Waypoints]:
    samples = 100.0 * np.array([0.0, 2.0, 2.1, 32.1, 32.2, 42.2, 44.0])
    steps = Waypoints(0.01, np.array([0.0, 0.0, 0.5, 0.5, 1.0, 1.0, 0.0]), samples, 5.0)
    return Plan("creep", steps, steps)


def frequency() -> Plan[Multisine]:
    """Lines every 10 Hz to 1 kHz, sampled at 10 kHz."""
    spectrum = np.zeros((3, 501), dtype=np.complex128)
    lines = np.arange(1, 101)
    phases = 2j * np.pi * np.random.default_rng(4).random((3, len(lines)))
    spectrum[:, lines] = np.minimum(1.0, 20.0 / lines) * np.exp(phases)
    waves = np.fft.irfft(spectrum, 1000)
    multisines = Multisine(1e-4, 1.5 * waves / np.abs(waves).max(), repeats=6)
    return Plan("frequency", multisines, multisines)


def bag(folder: Path, made: Recording) -> Path:
    drive, displacement = made.drive, made.displacement
    info = ScanInfo("s", 0, made.name, drive.sample_period, len(drive.x))
    with ScanWriter(folder / made.name, info) as writer:
        writer.add("drive_voltage", drive)
        writer.add("achieved_displacement", displacement)
    return folder / made.name


@pytest.fixture(scope="module")
def bags(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    folder = tmp_path_factory.mktemp("calibration")
    plans = creep(), frequency(), hysteresis_plan(levels=13)
    made = [bag(folder, record(plan, default_plant(), seed=1)) for plan in plans]
    return [word for each in made for word in (f"--{each.name}", str(each))]


def test_size_of_the_models(bags: list[str], tmp_path: Path) -> None:
    out = tmp_path / "model.yaml"
    arguments = [*bags, "--order", "3", "2", "--levels", "15", "--out", str(out)]
    done = CliRunner().invoke(identify, arguments, catch_exceptions=False)
    assert done.exit_code == 0
    model = load_model(out)
    assert model.x.hysteresis.forward.values.shape == (15, 15)
    assert len(model.y.vibration.denominator) == 4
    assert model.x.known_error is not None
    report = json.loads(out.with_suffix(".fit.json").read_text("utf-8"))
    assert report["x"]["vibration"]["order"] == "3 poles, 2 zeros"
    assert out.with_suffix(".fit.html").read_text("utf-8").startswith("<!DOCTYPE html>")


def test_a_sweep_with_hysteresis_in_it(bags: list[str], tmp_path: Path) -> None:
    """Thirteen reversal curves say little of loops as small as the sweep's."""
    chirp = Chirp(sample_period=1e-4)
    sweep = bag(tmp_path, record(Plan("frequency", chirp, chirp), default_plant(), seed=1))
    arguments = [*bags, "--frequency", str(sweep), "--out", str(tmp_path / "model.yaml")]
    with pytest.raises(InputError, match=r"hysteresis in the sweep: .* sweep with less amplitude"):
        CliRunner().invoke(identify, arguments, catch_exceptions=False)
    assert not (tmp_path / "model.yaml").exists()
