"""``afm-scan learn``: scans made in this process, and a few by the nodes."""

import json
import os
from pathlib import Path

import numpy as np
import pytest
from attrs import define
from click.testing import CliRunner, Result

from afm_scan_ros.bag.reader import read_scan
from afm_scan_ros.cli.main import cli
from afm_scan_ros.core.correction import Correction
from afm_scan_ros.core.errors import ScanError
from afm_scan_ros.core.metrics import Scan
from afm_scan_ros.core.model import ScannerModel
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.features.learning import learn_command as command
from afm_scan_ros.files import share_directory, yaml
from afm_scan_ros.files.drive_files import load_learned
from afm_scan_ros.files.plant_file import load_plant
from afm_scan_ros.files.records import to_mapping
from helpers.given_commands import commands_of
from helpers.in_process import InProcessSession, default_model, default_plant
from helpers.stage import stage

CONFIG = share_directory() / "config"
SPEC = ScanSpec(line_rate=50.0, lines=4, samples_per_line=400, preparation_cycles=5)


@define
class OneProcess(InProcessSession):
    """Keeps no bags, and so knows of no records."""

    sources = ()
    scans_left: int = 99

    def scan(
        self, label: str, spec: ScanSpec, model: ScannerModel, correction: Correction | None = None
    ) -> Scan:
        self.scans_left -= 1
        if self.scans_left < 0:
            raise ScanError("scanner_driver: the sensor is lost")
        return super().scan(label, spec, model, correction)


def scan_file(folder: Path, spec: ScanSpec = SPEC) -> Path:
    section = {"/**/trajectory_generator": {"ros__parameters": to_mapping(spec)}}
    yaml.save(folder / "spec.yaml", section, "A scan.")
    return folder / "spec.yaml"


def learn(folder: Path, *words: str, plant: str = "plant.yaml", scans_left: int = 99) -> Result:
    """Learn with scans in this process."""
    path = CONFIG / plant
    given = ["--spec", str(scan_file(folder)), "--plant", str(path), "--out", str(folder / "out")]
    with pytest.MonkeyPatch.context() as patch:
        session = OneProcess(load_plant(path), scans_left=scans_left)
        patch.setattr(command, "RecordedSession", lambda *_: session)
        return CliRunner().invoke(command.learn, [*given, *words])


def test_report_table_and_correction_agree(tmp_path: Path) -> None:
    done = learn(tmp_path, "--scans", "4")
    assert done.exit_code == 0, done.output
    found = json.loads((tmp_path / "out/learning.json").read_text("utf-8"))
    errors = [scan["tracking"]["measured"]["x"]["all"]["rms_m"] for scan in found["scans"]]
    assert errors[-1] < 0.5 * errors[0]
    assert found["best_scan"] == int(np.argmin(errors)) + 1
    assert found["scans"][2]["convergence"]["x"]["bound"] < 1.0
    learned = load_learned(tmp_path / "out/learned.npz")
    assert learned.correction.spec == SPEC
    page = (tmp_path / "out/report.html").read_text("utf-8")
    assert page.count("<figure>") == 3
    assert f"number {found['best_scan']}" in page
    again, diagnosed = commands_of(page)
    assert again[-4:-1] == ["--learned", str(tmp_path / "out/learned.npz"), "--bag"]
    assert diagnosed[1:4] == ["learn", "--spec", str(tmp_path / "spec.yaml")]


@pytest.mark.evidence
def test_the_learned_drive_teaches_the_diagnosis(tmp_path: Path) -> None:
    done = learn(tmp_path, "--scans", "4", "--diagnose", plant="plants/delay_large.yaml")
    assert done.exit_code == 0, done.output
    found = json.loads((tmp_path / "out/learning.json").read_text("utf-8"))["diagnosis"]
    assert found["effects"] == ["delay"]
    assert found["lacking_rms_after_m"]["x"] < 0.35 * found["lacking_rms_before_m"]["x"]
    assert (tmp_path / "out/model.extended.yaml").is_file()


def test_a_scan_that_fails_ends_learning_and_keeps_what_was_learned(tmp_path: Path) -> None:
    done = learn(tmp_path, scans_left=3)
    assert isinstance(done.exception, ScanError)
    assert "learning ended after 3 scans: scanner_driver: the sensor is lost" in str(done.exception)
    assert load_learned(tmp_path / "out/learned.npz").correction.x.any()
    assert "the sensor is lost" in (tmp_path / "out/report.html").read_text("utf-8")


@pytest.mark.evidence
def test_nodes_replay_what_was_learned(tmp_path: Path) -> None:
    """Real processes over DDS drive as one process does, but for rounding in other blocks."""
    done = learn(tmp_path, "--scans", "3")
    assert done.exit_code == 0, done.output
    file, bag = tmp_path / "out/learned.npz", tmp_path / "replayed"
    words = ["scan", "--spec", str(tmp_path / "spec.yaml"), "--learned", str(file)]
    done = CliRunner().invoke(cli, [*words, "--bag", str(bag)])
    assert done.exit_code == 0, done.output
    correction = load_learned(file).correction
    expected = InProcessSession(default_plant()).scan("", SPEC, default_model(), correction)
    drive = read_scan(bag).whole("drive_voltage")
    np.testing.assert_allclose(drive.x, expected.drive.x, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(drive.y, expected.drive.y, rtol=0.0, atol=1e-9)


@pytest.mark.evidence
def test_a_driver_that_fails_while_learning_leaves_the_outputs_at_rest(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    drivers = Path(__file__).parents[2] / "drivers"
    monkeypatch.setenv("PYTHONPATH", str(drivers), prepend=os.pathsep)
    log = tmp_path / "outputs.txt"
    settings = stage(tmp_path / "stage.yaml", output_log=str(log))
    out = tmp_path / "out"
    words = ["learn", "--spec", str(scan_file(tmp_path)), "--out", str(out), "--time-scale", "0"]
    words += ["--model", str(CONFIG / "model.yaml")]
    done = CliRunner().invoke(cli, [*words, "--scanner", f"faulty:FailsInThirdScan:{settings}"])
    assert "learning ended after 2 scans: " in str(done.exception)
    assert "the third scan" in str(done.exception)
    outputs = np.loadtxt(log, ndmin=2)
    assert np.any(outputs[:, 2:])
    assert not np.any(outputs[-1, 2:])
    found = json.loads((out / "learning.json").read_text("utf-8"))
    assert "the third scan" in found["failure"]
