"""What 'afm-scan identify' makes of three records of the simulated scanner."""

import json
from pathlib import Path
from typing import Any

import click
import pytest

from afm_scan_ros.cli import options
from afm_scan_ros.cli.identify import identify
from afm_scan_ros.cli.recorded import diagnose
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.drives.excitation import hysteresis_plan
from afm_scan_ros.files import share_directory
from afm_scan_ros.files.model_file import load_model
from helpers.in_process import default_plant, record
from helpers.small_records import bag, creep, frequency

MODEL = share_directory() / "config/model.yaml"


@pytest.fixture(scope="module")
def bags(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    folder = tmp_path_factory.mktemp("calibration")
    plans = creep(), frequency(), hysteresis_plan(levels=13)
    made = [bag(folder, record(plan, default_plant(), seed=1)) for plan in plans]
    return [word for each in made for word in (f"--{each.name}", str(each))]


@pytest.mark.evidence
def test_size_of_the_models(
    bags: list[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(options, "EVERY", 0.0)  # so that every step is reported
    out = tmp_path / "model.yaml"
    arguments = [*bags, "--order", "3", "2", "--levels", "15", "--out", str(out)]
    identify.main(arguments, standalone_mode=False)
    progress = capsys.readouterr().err
    for axis in ("x", "y"):
        assert f"identifying: {axis}: fitting creep (" in progress
        assert f"identifying: {axis}: fitting hysteresis and vibration alternately (" in progress
    model = load_model(out)
    assert model.x.hysteresis.forward.values.shape == (15, 15)
    assert len(model.y.vibration.denominator) == 4
    assert model.x.model_discrepancy is not None
    report = json.loads(out.with_suffix(".fit.json").read_text("utf-8"))
    assert report["x"]["vibration"]["order"] == "3 poles, 2 zeros"
    assert out.with_suffix(".fit.html").read_text("utf-8").startswith("<!DOCTYPE html>")


@pytest.mark.parametrize("command", [identify, diagnose])
def test_records_are_taken_to_begin_depolarised_where_that_is_stated(
    command: click.Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The value that reaches the Python interface, which other tests show to matter."""
    seen: list[str] = []

    def note(*given: Any, **_: Any) -> None:  # noqa: ANN401 - records stand at another place in each
        records = next(each for each in given if isinstance(each, list))
        seen.extend(record.start for record in records)
        raise InputError("seen")

    table = tmp_path / "scan.csv"
    table.write_text("time [s],drive_x [V],achieved_x [um]\n0,0,0\n1,1,5\n2,0,0\n", "utf-8")
    monkeypatch.setattr("afm_scan_ros.identification.identify", note)
    monkeypatch.setattr("afm_scan_ros.diagnosis.diagnose", note)
    model = ["--model", str(MODEL)] if command is diagnose else []
    for option in ([], ["--depolarised"]):
        arguments = [str(table), *model, *option, "--out", str(tmp_path / "out")]
        with pytest.raises(InputError, match="seen"):
            command.main(arguments, standalone_mode=False)
    assert seen == ["unknown", "depolarised"]
