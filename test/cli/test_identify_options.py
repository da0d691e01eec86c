"""What 'afm-scan identify' makes of three records of the simulated scanner."""

import json
from pathlib import Path

import pytest
from small_records import bag, creep, frequency

from afm_scan_ros.cli import working
from afm_scan_ros.cli.identify import identify
from afm_scan_ros.cli.in_process import record
from afm_scan_ros.core.identification.drives.excitation import hysteresis_plan
from afm_scan_ros.files.model_file import load_model
from helpers.in_process import default_plant


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
    monkeypatch.setattr(working, "EVERY", 0.0)  # so that every step is told
    out = tmp_path / "model.yaml"
    arguments = [*bags, "--order", "3", "2", "--levels", "15", "--out", str(out)]
    identify.main(arguments, standalone_mode=False)
    told = capsys.readouterr().err
    for axis in ("x", "y"):
        assert f"identifying: {axis}: fitting creep (" in told
        assert f"identifying: {axis}: fitting hysteresis and vibration alternately (" in told
    model = load_model(out)
    assert model.x.hysteresis.forward.values.shape == (15, 15)
    assert len(model.y.vibration.denominator) == 4
    assert model.x.model_discrepancy is not None
    report = json.loads(out.with_suffix(".fit.json").read_text("utf-8"))
    assert report["x"]["vibration"]["order"] == "3 poles, 2 zeros"
    assert out.with_suffix(".fit.html").read_text("utf-8").startswith("<!DOCTYPE html>")
