"""``afm-scan invert``: what a model's inverse gives is written, or the reason why not is stated."""

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import afm_scan_ros as afm
from afm_scan_ros.cli.main import main

MODEL = str(Path(__file__).parents[2] / "config/model.yaml")
PERIOD = 1e-4
PATH = np.outer(np.sin(np.linspace(0.0, np.pi, 1000)) ** 2, [5.0, 2.0])
Invert = Callable[..., tuple[object, str]]


@pytest.fixture
def invert(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Invert:
    """Run the command on a path in µm with these headings; return its status and its output."""

    def run(path: np.ndarray, headings: str, *options: str) -> tuple[object, str]:
        table = np.column_stack([PERIOD * np.arange(len(path)), path])
        np.savetxt(tmp_path / "path.csv", table, delimiter=",", header=headings, comments="")
        files = ["--desired", str(tmp_path / "path.csv"), "--out", str(tmp_path / "drive.csv")]
        monkeypatch.setattr(sys, "argv", ["afm-scan", "invert", "--model", MODEL, *files, *options])
        with pytest.raises(SystemExit) as end:
            main()
        message = capsys.readouterr()
        return end.value.code, message.out + message.err

    return run


def test_the_drive_is_that_of_the_model(invert: Invert, tmp_path: Path) -> None:
    status, message = invert(PATH, "time_s,desired_x_um,desired_y_um")
    assert not status
    assert "drive.csv holds 1000 samples of the drive" in message
    heading, *_ = (tmp_path / "drive.csv").read_text("utf-8").splitlines()
    assert heading == "time_s,drive_x_v,drive_y_v"
    table = np.loadtxt(tmp_path / "drive.csv", delimiter=",", skiprows=1)
    drive = afm.load_model(MODEL).invert(1e-6 * PATH, PERIOD)
    np.testing.assert_allclose(table[:, 1:], drive, rtol=1e-7, atol=1e-9)
    np.testing.assert_allclose(table[:, 0], PERIOD * np.arange(1000), atol=1e-9)


def test_a_drive_beyond_the_limit_is_status_3(invert: Invert, tmp_path: Path) -> None:
    status, message = invert(PATH, "time_s,desired_x_um,desired_y_um", "--limit", "100mV")
    assert status == 3
    assert "beyond the amplifier's 0.1" in message
    assert not (tmp_path / "drive.csv").exists()


def test_a_limit_of_zero_is_refused_by_the_option_s_name(invert: Invert) -> None:
    status, message = invert(PATH, "time_s,desired_x_um,desired_y_um", "--limit", "0V")
    assert status == 2
    assert "--limit" in message
    assert "give a positive number" in message


def test_a_path_of_other_axes_is_refused_by_what_is_lacking(invert: Invert) -> None:
    status, message = invert(PATH[:, :1], "time_s,desired_x_um")
    assert status == 2
    assert "the model's axes ask for desired_x, desired_y: name these columns" in message


@pytest.mark.parametrize("headings", ["t,u,w", "time_s,position_x_um,position_y_um", "1,2,3"])
def test_a_table_that_does_not_name_the_path_is_told_how(invert: Invert, headings: str) -> None:
    status, message = invert(PATH, headings)
    assert status == 2
    assert "--columns time=1:s,desired_x=2:um" in message
    assert "drive_x" not in message


def test_nothing_is_overwritten(invert: Invert, tmp_path: Path) -> None:
    (tmp_path / "drive.csv").write_text("mine", "utf-8")
    status, message = invert(PATH, "time_s,desired_x_um,desired_y_um")
    assert status == 2
    assert "drive.csv exists already: give another file" in message
    assert (tmp_path / "drive.csv").read_text("utf-8") == "mine"
