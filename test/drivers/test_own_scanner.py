"""The tutorial of one's own scanner, as it is typed: driver, settings, scan."""

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from afm_scan_ros.bag.reader import read_scan

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs/tutorials/own_scanner.md").read_text("utf-8")
FENCE = re.compile(r"^```(python|yaml|bash)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
BLOCKS: list[tuple[str, str]] = FENCE.findall(PAGE)
COMMAND = "from afm_scan_ros.cli.main import main; main()"
MOST_LINES = 40


def block(kind: str) -> str:
    return next(text for name, text in BLOCKS if name == kind)


def afm_scan(folder: Path, line: str) -> "subprocess.CompletedProcess[str]":
    program, *arguments = shlex.split(line)
    assert program == "afm-scan"
    paths = os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])
    environment = {**os.environ, "PYTHONPATH": paths}
    environment.pop("ROS_DOMAIN_ID", None)  # the command then takes one that nobody uses
    return subprocess.run(
        [sys.executable, "-c", COMMAND, *arguments],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Write the files of the page."""
    (tmp_path / "mylab.py").write_text(block("python"), "utf-8")
    (tmp_path / "stage.yaml").write_text(block("yaml"), "utf-8")
    _, model = (text for name, text in BLOCKS if name == "python")
    monkeypatch.chdir(tmp_path)
    exec(model, {})  # noqa: S102 - what the page has a reader type
    return tmp_path


@pytest.mark.evidence
def test_the_scan_has_the_displacement_of_the_toy(folder: Path) -> None:
    for line in block("bash").splitlines():
        done = afm_scan(folder, line)
        assert done.returncode == 0, done.stderr
    recording = read_scan(folder / "own")
    drive = recording.whole("drive_voltage").x
    moved = recording.whole("achieved_displacement").x
    expected = 8.9e-6 * 0.9 * np.concatenate([[0.0], drive[:-1]])
    noise = moved - expected
    assert np.std(noise) == pytest.approx(8.9e-6 * 2e-4, rel=0.05)
    assert abs(np.mean(noise)) < 5.0 * np.std(noise) / np.sqrt(noise.size)
    assert (folder / "own.html").is_file()


@pytest.mark.evidence
def test_a_wrong_option_is_refused_in_one_line(folder: Path) -> None:
    path = folder / "stage.yaml"
    path.write_text(path.read_text("utf-8").replace("card: toy0", "cart: toy0"), "utf-8")
    done = afm_scan(folder, block("bash").splitlines()[0])
    assert done.returncode == 2
    said = "stage.yaml: options: unknown key 'cart'; did you mean 'card'?"
    assert said in done.stderr.splitlines()[-1]
    assert "Traceback" not in done.stderr


def test_the_driver_has_40_lines() -> None:
    lines = [line for line in block("python").splitlines() if line.strip()]
    assert len(lines) <= MOST_LINES
