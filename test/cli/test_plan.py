"""``afm-scan plan``: a table, and drives as files that a lab's converter can take."""

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from afm_scan_ros.cli.calibrate import calibrate
from afm_scan_ros.cli.plan import plan

OPTIONS = ["--range", "20um", "--limit", "10 V", "--rate", "2kHz", "--hold", "10s"]


def test_drives_are_written_as_text_and_arrays(tmp_path: Path) -> None:
    result = CliRunner().invoke(plan, [*OPTIONS, "--axis", "x", "--export", str(tmp_path / "out")])
    assert result.exit_code == 0, result.output
    rows = json.loads((tmp_path / "out/plan.json").read_text())["rows"]
    assert [row["record"] for row in rows] == ["survey", "creep"]
    for row in rows:
        path = tmp_path / "out" / f"{row['record']}.csv"
        text = np.loadtxt(path, delimiter=",", skiprows=1)
        with np.load(path.with_suffix(".npz")) as arrays:
            np.testing.assert_allclose(text, arrays["drive_v"][:, 0], rtol=1e-6, atol=1e-12)
            assert 1.0 / float(arrays["sample_period_s"]) == pytest.approx(row["samples_per_s"])
        assert len(text) / row["samples_per_s"] == pytest.approx(60.0 * row["minutes"], rel=1e-6)
    assert "drive_x=1:V,achieved_x=2:um" in (tmp_path / "out/README.md").read_text()


@pytest.mark.evidence
def test_nothing_is_overwritten(tmp_path: Path) -> None:
    arguments = [*OPTIONS, "--export", str(tmp_path)]
    assert CliRunner().invoke(plan, arguments).exit_code == 0
    again = CliRunner().invoke(plan, arguments)
    assert "exists already" in str(again.exception)


@pytest.mark.parametrize("wrong", ["20", "20 bananas", "um"])
def test_a_number_without_its_unit_is_refused(wrong: str) -> None:
    result = CliRunner().invoke(plan, ["--range", wrong, *OPTIONS[2:]])
    assert result.exit_code == 2
    assert "not a number with a unit" in result.output


@pytest.mark.parametrize("wrong", ["0um", "-20um", "1e999um"])
def test_a_number_that_is_no_size_is_refused(wrong: str) -> None:
    result = CliRunner().invoke(plan, ["--range", wrong, *OPTIONS[2:]])
    assert result.exit_code == 2
    assert "give a" in result.output


def test_calibrate_exports_its_drives_without_driving(tmp_path: Path) -> None:
    arguments = ["--experiment", "rest", "--export", str(tmp_path)]
    result = CliRunner().invoke(calibrate, arguments)
    assert result.exit_code == 0, result.output
    with np.load(tmp_path / "rest.npz") as arrays:
        assert arrays["drive_v"].shape == (60_001, 2)
