"""Each error of an import names the remedy, and that works."""

import sys
from pathlib import Path

import numpy as np
import pytest

import afm_scan_ros as afm
from afm_scan_ros.cli.main import main

PERIOD = 1e-3
TIME = PERIOD * np.arange(2000)
RNG = np.random.default_rng(4)
DRIVE = 2.0 * np.sin(4.0 * np.pi * TIME) * np.linspace(0.2, 1.0, len(TIME))
MOVED = 5.0 * DRIVE + 2e-3 * RNG.standard_normal(len(TIME))
COLUMNS = "time=1:s,drive_x=2:V,achieved_x=3:um"
UNTIMED = "drive_x=2:V,achieved_x=3:um"


class Command:
    """``afm-scan import-csv`` of one file: its status, and what it writes on stderr."""

    def __init__(
        self, folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
    ) -> None:
        self.file, self.bag = folder / "own.csv", folder / "bag"
        self._patch, self._captured = monkeypatch, capsys

    def write(self, *columns: np.ndarray) -> None:
        np.savetxt(self.file, np.column_stack(columns), fmt="%.9g", delimiter=",")

    def refused(self, *options: object) -> str:
        status, message = self._run(*options)
        assert status == 2, message
        assert f"{self.file}: " in message
        assert not self.bag.exists()
        return message

    def taken(self, *options: object) -> afm.Record:
        status, message = self._run(*options)
        assert not status, message
        return afm.read_record(self.bag)

    def _run(self, *options: object) -> tuple[object, str]:
        words = ["import-csv", self.file, "--bag", self.bag, *options]
        self._patch.setattr(sys, "argv", ["afm-scan", *map(str, words)])
        with pytest.raises(SystemExit) as end:
            main()
        return end.value.code, self._captured.readouterr().err


@pytest.fixture
def command(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Command:
    return Command(tmp_path, monkeypatch, capsys)


def test_irregular_times_of_an_even_clock(command: Command) -> None:
    command.write(TIME + 1e-4 * RNG.standard_normal(len(TIME)), DRIVE, MOVED)
    message = command.refused("--columns", COLUMNS)
    assert "give the sample rate instead of the column time" in message
    found = command.taken("--columns", UNTIMED, "--sample-rate", 1000)
    assert (found.sample_period, len(found.drive)) == (PERIOD, len(TIME))


def test_a_gap(command: Command) -> None:
    kept = np.delete(np.arange(len(TIME)), slice(1200, 1230))
    command.write(TIME[kept], DRIVE[kept], MOVED[kept])
    message = command.refused("--columns", COLUMNS)
    assert "time runs 0.031 s from row 1200 to row 1201" in message
    assert "separately, with --start-row and --stop-row" in message
    found = command.taken("--columns", COLUMNS, "--stop-row", 1200)
    np.testing.assert_allclose(found.drive[:, 0], DRIVE[:1200], atol=1e-8)


def test_a_heading_with_numbers_in_it(command: Command) -> None:
    command.write(TIME, DRIVE, MOVED)
    rows = command.file.read_text("utf-8")
    command.file.write_text("channels,3,4\n" + rows, "utf-8")
    message = command.refused("--columns", COLUMNS)
    assert "give --skip-rows 1 where the line is a heading" in message
    assert len(command.taken("--columns", COLUMNS, "--skip-rows", 1).drive) == len(TIME)


def test_a_damaged_row_at_the_end(command: Command) -> None:
    command.write(TIME, DRIVE, MOVED)
    rows = command.file.read_text("utf-8")
    command.file.write_text(f"{rows}2.0,cut,\n", "utf-8")
    message = command.refused("--columns", COLUMNS)
    assert "line 2001, column 2: 'cut' is not a number: correct the cell" in message
    command.file.write_text(rows, "utf-8")
    assert len(command.taken("--columns", COLUMNS).drive) == len(TIME)


def test_a_sensor_of_the_other_sign(command: Command) -> None:
    command.write(TIME, DRIVE, -MOVED)
    message = command.refused("--columns", COLUMNS, "--record", "hysteresis")
    assert "falls where its drive rises" in message
    assert "import it in a unit of the other sign, as -um" in message
    other = COLUMNS.replace(":um", ":-um")
    found = command.taken("--columns", other, "--record", "hysteresis")
    np.testing.assert_allclose(found.displacement[:, 0], 1e-6 * MOVED, rtol=1e-6, atol=1e-14)


def test_micrometres_that_were_taken_for_metres(command: Command) -> None:
    command.write(TIME, DRIVE, MOVED)
    wrong = COLUMNS.replace(":um", ":m")
    message = command.refused("--columns", wrong, "--record", "hysteresis")
    assert "is it in µm or in the sensor's V?" in message
    assert "say its unit in --columns" in message
    assert command.taken("--columns", COLUMNS, "--record", "hysteresis").kind == "hysteresis"


def test_headings_of_ones_own(command: Command) -> None:
    command.write(TIME, DRIVE, MOVED)
    command.file.write_text("t,u,y\n" + command.file.read_text("utf-8"), "utf-8")
    message = command.refused()
    assert "its headings are t, u, y, none of which states what it holds" in message
    assert "--columns time=1:s,drive_x=2:V,achieved_x=3:um" in message
    found = command.taken("--columns", "time=t:s,drive_x=u:V,achieved_x=y:um")
    np.testing.assert_allclose(found.displacement[:, 0], 1e-6 * MOVED, rtol=1e-6, atol=1e-14)


def test_a_sensor_in_volts(command: Command) -> None:
    command.write(TIME, DRIVE, MOVED)
    command.file.write_text(
        "time [s],drive_x [V],achieved_x [V]\n" + command.file.read_text("utf-8"), "utf-8"
    )
    assert "give the sensor's scale, as 8um/V" in command.refused()
    found = command.taken("--columns", "time=1:s,drive_x=2:V,achieved_x=3:8um/V")
    np.testing.assert_allclose(found.displacement[:, 0], 8e-6 * MOVED, rtol=1e-6, atol=1e-13)


def test_jitter_below_the_noise_is_reported(
    command: Command, caplog: pytest.LogCaptureFixture
) -> None:
    command.write(TIME + 2e-6 * RNG.standard_normal(len(TIME)), DRIVE, MOVED)
    command.file.write_text(
        "time [s],drive_x [V],achieved_x [um]\n" + command.file.read_text("utf-8"), "utf-8"
    )
    found = afm.read_record(command.file)
    (note,) = found.shortcomings
    assert "own.csv: time jitters by 2e-06 s rms" in note
    found.warn()
    assert note in caplog.text
