"""Measured data from files into bags: what was there comes back, and bad files are refused."""

import json
import sys
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from click.testing import CliRunner
from hypothesis import given, settings
from hypothesis import strategies as st

from afm_scan_ros.bag.reader import ScanRecording, read_scan
from afm_scan_ros.cli.import_csv import import_csv
from afm_scan_ros.cli.main import main

ROWS = np.array([[0.0, 1.0, -20.5], [0.5, 2.0, -19.5], [1.0, 3.5, -18.0], [1.5, 3.0, -18.25]])
BOTH = "drive_x=1:V,drive_y=2:mV,achieved_x=3:um,achieved_y=1:nm"
ONE = "drive_x=2:V,achieved_x=3:um"


def imported(bag: Path, *arguments: object) -> ScanRecording:
    """Run the command with a bag that it makes, and open that."""
    words = [str(word) for word in (*arguments, "--bag", bag)]
    result = CliRunner().invoke(import_csv, words, catch_exceptions=False)
    assert result.exit_code == 0, result.output
    return read_scan(bag)


@pytest.mark.parametrize(
    ("separator", "heading"), [(",", "u,v,y\n"), (";", "# u;v;y\n"), ("\t", ""), ("   ", "")]
)
def test_text_of_each_habit(tmp_path: Path, separator: str, heading: str) -> None:
    file = tmp_path / "data.csv"
    lines = "\r\n".join(separator.join(map(str, row)) for row in ROWS)
    file.write_text(heading + lines + "\n\n", "utf-8-sig")
    bag = imported(tmp_path / "bag", file, "--columns", BOTH, "--sample-rate", 200)
    drive, achieved = bag.whole("drive_voltage"), bag.whole("achieved_displacement")
    np.testing.assert_allclose(drive.x, ROWS[:, 0])
    np.testing.assert_allclose(drive.y, 1e-3 * ROWS[:, 1])
    np.testing.assert_allclose(achieved.x, 1e-6 * ROWS[:, 2])
    np.testing.assert_allclose(achieved.y, 1e-9 * ROWS[:, 0])
    assert "desired_displacement" not in bag.topics
    assert (bag.info.sample_period, bag.info.total_samples) == (5e-3, len(ROWS))
    assert (bag.info.pattern, bag.info.spec, bag.warnings) == ("imported", None, ())


def test_columns_by_their_names_and_time(tmp_path: Path) -> None:
    file = tmp_path / "data.csv"
    lines = "\n".join(f"{k};{u};{y}" for k, (_, u, y) in enumerate(ROWS))
    file.write_text(f"made by hand\nclock;in;out\n{lines}\n", "utf-8")
    columns = "time=clock:ms,drive_y=in:V,achieved_y=out:um"
    options = ["--columns", columns, "--record", "ramp"]
    bag = imported(tmp_path / "bag", file, *options)
    assert bag.info.sample_period == pytest.approx(1e-3)
    assert bag.info.pattern == "ramp_y_only"
    assert not bag.whole("drive_voltage").x.any()
    np.testing.assert_allclose(bag.whole("drive_voltage").y, ROWS[:, 1])


def test_arrays_of_several_files(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    drive, moved = rng.normal(size=(2500, 2)), rng.normal(size=(2500, 3, 2))
    np.save(tmp_path / "u.npy", drive)
    np.save(tmp_path / "y.npy", moved.astype(np.float32))
    columns = "drive_x=1:V,drive_y=2:V,achieved_x=3:m,achieved_y=8:m"
    options = ["--columns", columns, "--sample-rate", 6400, "--start-row", 101, "--stop-row", 2400]
    bag = imported(tmp_path / "bag", tmp_path / "u.npy", tmp_path / "y.npy", *options)
    np.testing.assert_array_equal(bag.whole("drive_voltage").y, drive[100:2400, 1])
    np.testing.assert_allclose(bag.whole("achieved_displacement").x, moved[100:2400, 0, 0], 1e-6)
    np.testing.assert_allclose(bag.whole("achieved_displacement").y, moved[100:2400, 2, 1], 1e-6)


Refused = Callable[..., str]


@pytest.fixture
def refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Refused:
    """Import, which must end with status 2, one line on stderr and no bag; return that line."""

    def run(file: Path, columns: str, *options: object) -> str:
        bag = tmp_path / "bag"
        words = ["import-csv", file, "--columns", columns, "--bag", bag, *options]
        monkeypatch.setattr(sys, "argv", ["afm-scan", *map(str, words)])
        with pytest.raises(SystemExit) as end:
            main()
        message = capsys.readouterr().err
        assert (end.value.code, message.count("\n")) == (2, 1), message
        assert not bag.exists()
        return message

    return run


IN_TEXT = {
    "not a number": (
        "0 1\n1 2\n2 two\n",
        "line 3, column 2: 'two' is not a number: correct the cell",
    ),
    "no number in the first row": (
        "zero 1\n1 2\n2 3\n3 4\n",
        "line 1, column 1: 'zero' is not a number: correct the cell, or give --skip-rows 1",
    ),
    "marks for thousands": (
        "0;1,234.5\n1;2,500.5\n2;3,500.5\n3;4,500.5\n",
        "line 1, column 2: '1,234.5' is not a number: correct the cell",
    ),
    "marks for thousands within quotation marks": (
        '0,"12.5"\n1,"1,200.5"\n2,"1,201.5"\n3,"1,202.5"\n',
        "columns, those below have 3: correct the line, or write numbers without marks for",
    ),
    "two decimal marks": (
        "0;1,5\n1;2.5\n2;3,5\n3;4,5\n",
        "line 1, column 2: '1,5' has a comma where other rows have a point",
    ),
    "an empty cell": ("0,1\n1,\n2,3\n", "line 2, column 2: '' is not a number: correct"),
    "NaN": ("0 1\n1 nan\n", "line 2, column 2: 'nan' is not finite: correct"),
    "infinity": ("0 1\n-inf 2\n", "line 2, column 1: '-inf' is not finite: correct"),
    "a short row": ("# u y\n0 1\n1\n2 3\n", "line 3 has 1 columns, line 2 has 2: correct the line"),
    "a long row": ("0,1\n1,2,3\n", "line 1 has 2 columns, those below have 3: correct"),
    "a blank line": ("0 1\n\n2 3\n", "line 2 has 0 columns, line 1 has 2"),
    "nothing": ("", "no rows: give columns of drive and displacement"),
    "only remarks": ("# one\n# two\n", "no rows: give columns of drive and displacement"),
    "one row": ("0 1\n", "1 row of numbers: give 2 at least"),
}


@pytest.mark.parametrize("case", IN_TEXT)
def test_a_wrong_text(refused: Refused, tmp_path: Path, case: str) -> None:
    text, reason = IN_TEXT[case]
    file = tmp_path / "data.txt"
    file.write_text(text, "utf-8")
    options = ("--sample-rate", 100)
    message = refused(file, "drive_x=1:V,achieved_x=2:um", *options)
    assert reason in message
    assert case == "one row" or str(file) in message


RATE = ("--sample-rate", 100)
IN_WORDS = [
    ("drive_x=1:V,achieved_x=3:furlong", RATE, "'furlong' is not a unit of it"),
    ("drive_x=1:um,achieved_x=3:um", RATE, "give one of uV, mV, V, kV"),
    (
        "drive_x=1:V,height_x=3:um",
        RATE,
        "'height_x' is not a quantity: give some of time",
    ),
    ("drive_x=1:,achieved_x=3:um", RATE, "'drive_x=1:' is not of the form NAME=COLUMN"),
    ("drive_x=1,achieved_x=3:um", RATE, "has no unit: give it, as drive_x=1:UNIT"),
    ("drive_x=1:V,achieved_x=3:V", RATE, "give the sensor's scale, as 8um/V"),
    ("drive_x=1:V,achieved_x=3:0um", RATE, "'0um' makes all of it zero"),
    ("drive_x=1:V,drive_x=2:V", RATE, "drive_x is given twice"),
    ("drive_x=4:V,achieved_x=3:um", RATE, "column 4: there are columns 1 to 3"),
    ("drive_x=0:V,achieved_x=3:um", RATE, "column 0: there are columns 1 to 3"),
    ("drive_x=in:V,achieved_x=3:um", RATE, "and no heading names them: give a number"),
    ("drive_x=1:V,drive_y=2:V,achieved_x=3:um", RATE, "no achieved_y: name its column, or leave"),
    ("drive_1=1:V,achieved_1=2:um", RATE, "a bag holds the axes x and y, not 1"),
    (ONE, (), "either a sample rate or a column 'time'"),
    (f"time=1:s,{ONE}", RATE, "either a sample rate or a column 'time'"),
    ("time=1:s", (), "no column is drive or displacement"),
    (ONE, ("--sample-rate", 0), "'0' is not above zero: give a positive number"),
    (ONE, ("--sample-rate", "nan"), "'nan' is not a number with a unit"),
    (ONE, (*RATE, "--stop-row", 5), "rows 1 to 5 of 4"),
    (ONE, (*RATE, "--start-row", 4), "rows 4 to 4 of 4"),
    (
        ONE,
        (*RATE, "--record", "raster"),
        "--record raster: this is the name of a scan pattern",
    ),
]


@pytest.mark.parametrize(("columns", "options", "reason"), IN_WORDS)
def test_wrong_arguments(
    refused: Refused, tmp_path: Path, columns: str, options: tuple[object, ...], reason: str
) -> None:
    file = tmp_path / "data.dat"
    np.savetxt(file, ROWS)
    assert reason in refused(file, columns, *options)


@pytest.mark.parametrize(
    ("time", "reason"),
    [
        ([0.0, 1.0, 2.0, 5.0, 6.0, 7.0], "time runs 3 s from row 3 to row 4, elsewhere 1 s"),
        ([0.0, 1.0, 1.0, 2.0, 3.0, 4.0], "time runs 0 s from row 2 to row 3, elsewhere 1 s"),
        ([0.0, 1.1, 2.0, 3.2, 4.0, 5.1], "time is irregular: its steps are 0.8 to 1.2 s"),
        ([0.0, 0.0, 0.0, 1.0, 1.0, 1.0], "time is irregular: its steps are 0 to 1 s"),
        ([5.0, 4.0, 3.0, 2.0, 1.0, 0.0], "time falls from 5 to 0 s: sort the rows"),
    ],
)
def test_uneven_time(refused: Refused, tmp_path: Path, time: list[float], reason: str) -> None:
    file = tmp_path / "data.dat"
    np.savetxt(file, np.column_stack([time, np.arange(6.0)]))
    assert reason in refused(file, "time=1:s,drive_x=2:V")


WRONG_ARRAYS = {
    "complex": np.ones((5, 2), dtype=complex),
    "words": np.array([["a", "b"]] * 5),
    "empty": np.empty((0, 2)),
    "one number": np.array(1.0),
}


@pytest.mark.parametrize("kind", WRONG_ARRAYS)
def test_a_wrong_array(refused: Refused, tmp_path: Path, kind: str) -> None:
    file = tmp_path / "data.npy"
    np.save(file, WRONG_ARRAYS[kind])
    assert f"{file}: holds " in refused(file, "drive_x=1:V", *RATE)


def test_nan_in_an_array(refused: Refused, tmp_path: Path) -> None:
    file = tmp_path / "data.npy"
    np.save(file, np.array([[0.0, 1.0], [1.0, np.nan]]))
    assert "row 2, column 2: nan is not finite" in refused(file, "drive_x=2:V", *RATE)


@pytest.mark.parametrize(
    ("name", "reason"), [("a.npy", "no array that"), ("a.dat", "neither text nor")]
)
def test_what_is_neither_text_nor_array(
    refused: Refused, tmp_path: Path, name: str, reason: str
) -> None:
    file = tmp_path / name
    file.write_bytes(bytes(range(256)))
    assert reason in refused(file, "drive_x=1:V", *RATE)


def test_files_of_unequal_length(refused: Refused, tmp_path: Path) -> None:
    for name, rows in (("a", 5), ("b", 6)):
        np.savetxt(tmp_path / name, np.ones(rows))
    columns = "drive_x=1:V,achieved_x=2:um"
    message = refused(tmp_path / "a", columns, tmp_path / "b", *RATE)
    assert "drive_x 5, achieved_x 6: give columns of one recording" in message


def test_an_array_has_no_lines_to_skip(refused: Refused, tmp_path: Path) -> None:
    file = tmp_path / "data.npy"
    np.save(file, ROWS)
    assert "omit --skip-rows" in refused(file, ONE, *RATE, "--skip-rows", 1)


@given(st.integers(2, 5), st.floats(1e-6, 1e3))
@settings(deadline=None, max_examples=20)
def test_even_times_give_their_period(rows: int, period: float) -> None:
    with TemporaryDirectory() as folder:
        file = Path(folder) / "data.csv"
        np.savetxt(file, np.column_stack([period * np.arange(rows), np.arange(rows)]))
        bag = imported(Path(folder) / "bag", file, "--columns", "time=1:s,drive_x=2:V")
        assert bag.info.sample_period == pytest.approx(period)


def test_analysis_of_what_was_imported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    rng = np.random.default_rng(0)
    desired, error = np.sin(np.arange(2500.0)), rng.normal(size=2500)
    np.save(tmp_path / "data.npy", np.column_stack([desired, desired + error]))
    columns = "desired_x=1:um,achieved_x=2:um"
    imported(tmp_path / "bag", tmp_path / "data.npy", "--columns", columns, *RATE)
    json_file = tmp_path / "figures.json"
    words = ["afm-scan", "analyze", str(tmp_path / "bag"), "--json", str(json_file)]
    monkeypatch.setattr(sys, "argv", words)
    with pytest.raises(SystemExit) as end:
        main()
    assert not end.value.code
    assert "x: achieved minus desired: rms" in capsys.readouterr().out
    found = json.loads(json_file.read_text("utf-8"))
    assert found["y"] is None
    assert found["x"]["rms_m"] == pytest.approx(1e-6 * np.sqrt(np.mean(error**2)))
    assert found["x"]["largest_m"] == pytest.approx(1e-6 * np.abs(error).max())
    assert np.hypot(found["x"]["mean_m"], found["x"]["spread_m"]) == pytest.approx(
        found["x"]["rms_m"]
    )


RNG = np.random.default_rng(5)
DRIVE = np.interp(np.arange(400.0), np.linspace(0.0, 400.0, 9), [0, 1, -1, 2, -1, 0, 1, 0, 0])
GOOD = np.column_stack([DRIVE, 5.0 * DRIVE + 2e-3 * RNG.standard_normal(400)])
SPOILT = {
    "micrometres for metres": (GOOD, "m", "is it in µm or in the sensor's V? record it in m"),
    "constant": (GOOD * [1.0, 0.0], "um", "displacement x never changes"),
    "clipped": (np.minimum(GOOD, 4.0), "um", "displacement x is clipped at its upper end"),
    "three rows": (GOOD[:3], "um", "it holds 3 samples"),
}


@pytest.mark.parametrize("damage", SPOILT)
def test_a_record_that_cannot_be_identified(refused: Refused, tmp_path: Path, damage: str) -> None:
    rows, unit, reason = SPOILT[damage]
    file = tmp_path / "data.npy"
    np.save(file, rows)
    columns = f"drive_x=1:V,achieved_x=2:{unit}"
    message = refused(file, columns, *RATE, "--record", "hysteresis")
    assert f"{file}: " in message
    assert reason in message


def test_data_for_another_use_are_imported_with_a_warning(tmp_path: Path) -> None:
    np.save(tmp_path / "data.npy", np.minimum(GOOD, 4.0))
    columns = "drive_x=1:V,achieved_x=2:um"
    words = [str(tmp_path / "data.npy"), "--columns", columns, "--bag", str(tmp_path / "bag")]
    result = CliRunner().invoke(import_csv, [*words, *map(str, RATE)])
    assert result.exit_code == 0
    assert "data.npy: displacement x is clipped at its upper end" in result.output
    assert (tmp_path / "bag" / "metadata.yaml").exists()
