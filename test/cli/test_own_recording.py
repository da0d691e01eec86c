"""The tutorial of one's own recording, as it is typed: files, model, drive, diagnosis."""

import json
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import afm_scan_ros as afm

pytestmark = pytest.mark.evidence

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs/tutorials/own_recording.md").read_text("utf-8")
BLOCKS = re.findall(r"^```(python|py|bash)\n(.*?)^```$", PAGE, re.MULTILINE | re.DOTALL)
COMMAND = "from afm_scan_ros.cli.main import main; main()"


def run(kind: str, block: str, folder: Path) -> None:
    words = ["-c", block]
    if kind == "bash":
        program, *arguments = shlex.split(block.replace("\\\n", " "))
        assert program == "afm-scan"
        words = ["-c", COMMAND, *arguments]
    paths = os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])
    environment = {**os.environ, "PYTHONPATH": paths}
    done = subprocess.run(
        [sys.executable, *words],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Run all commands of the page, in its order."""
    folder = tmp_path_factory.mktemp("tutorial")
    for kind, block in BLOCKS:
        run(kind, block, folder)
    return folder


def test_it_takes_four_commands() -> None:
    assert [kind for kind, _ in BLOCKS].count("bash") == 4


def test_the_model_is_that_of_the_axis(folder: Path) -> None:
    model = afm.load_model(folder / "own.yaml")
    assert model.axes == ("x",)
    time = np.arange(2000) / 10e3
    drive = 2.0 * np.sin(20.0 * np.pi * time)
    true = afm.load_model().predict(np.column_stack([drive, 0.0 * drive]), 1e-4)[:, 0]
    found = model.predict(drive, 1e-4)
    assert np.std(found - true) < 2e-3 * np.ptp(true)


def test_the_drive_makes_the_scanner_follow(folder: Path) -> None:
    drive = np.loadtxt(folder / "drive.csv", delimiter=",", skiprows=1)[:, 1]
    path = 1e-6 * np.loadtxt(folder / "path.csv", delimiter=",", skiprows=1)[:, 1]
    moved = afm.load_model().predict(np.column_stack([drive, 0.0 * drive]), 5e-5)[:, 0]
    gain = np.sum(drive * path) / np.sum(drive**2)
    assert np.std(moved - path) < 2e-3 * np.ptp(path)
    assert np.std(gain * drive - path) > 30.0 * np.std(moved - path)


def test_without_a_held_step_an_offset_is_left(folder: Path) -> None:
    """As the page states in nm: 30 rms, with the step too, and a shape within 5."""
    records = [afm.read_record(folder / f"{name}.csv") for name in ("waves", "moves")]
    path = 1e-6 * np.loadtxt(folder / "path.csv", delimiter=",", skiprows=1)[:, 1]
    drive = afm.identify(records).invert(path, 5e-5)
    error = afm.load_model().predict(np.column_stack([drive, 0.0 * drive]), 5e-5)[:, 0] - path
    assert 20e-9 < np.sqrt(np.mean(error**2)) < 50e-9
    assert np.std(error) < 8e-9


def test_the_delay_is_found(folder: Path) -> None:
    found = json.loads((folder / "second_diagnosis/diagnosis.json").read_text("utf-8"))
    (effect,) = found["effects"]
    assert effect["name"] == "delay"
    low, high = effect["parameters"]["delay"]["interval_95"]
    assert low < 200e-6 < high < 1.2 * 200e-6
    assert found["residual_rms_after_m"]["x"] < 0.2 * found["residual_rms_before_m"]["x"]
