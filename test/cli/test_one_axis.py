"""A scanner of which one axis was recorded: from text or arrays to that axis' model."""

import json
from pathlib import Path

import numpy as np
import pytest
from attrs import evolve
from click.testing import CliRunner

from afm_scan_ros import identification as api
from afm_scan_ros.cli.identify import identify
from afm_scan_ros.cli.import_csv import import_csv
from afm_scan_ros.core.identification.drives.excitation import Plan
from afm_scan_ros.core.model import Status
from afm_scan_ros.core.record import Record
from afm_scan_ros.model import Model, load_model
from helpers.in_process import default_plant, record
from helpers.small_records import bag, creep, frequency, levels

PLANS = creep(), frequency(), Plan("hysteresis", 5e-5, *map(levels, (8, 9)))
RESONANCE = 453.9363  # Hz, of the least damped root of Eq. 5


@pytest.fixture(scope="module")
def records() -> list[Record]:
    return [record(plan, default_plant(), seed=1) for plan in PLANS]


def imported(folder: Path, made: Record, axis: str) -> str:
    """Import one axis of a record, the other being absent; return its bag."""
    array = folder / f"{made.name}_{axis}.npy"
    np.save(array, np.column_stack(made.signals(axis)))
    columns = f"drive_{axis}=1:V,achieved_{axis}=2:m"
    rate = repr(1.0 / made.sample_period)
    options = ["--columns", columns, "--sample-rate", rate]
    target = folder / f"{made.name}_{axis}"
    words = [str(array), *options, "--record", made.name, "--bag", str(target)]
    result = CliRunner().invoke(import_csv, words, catch_exceptions=False)
    assert result.exit_code == 0, result.output
    return str(target)


def same_as_from_arrays(model: Model, records: list[Record], path: Path) -> None:
    """See that arrays give the same model bit for bit, although no kind is stated."""
    given = [evolve(each.axis("y"), name="") for each in records]
    api.identify(given).save(path)
    found, known = (each.scanner.axis("y") for each in (load_model(path), model))
    assert model.axes == ("y",)
    assert found == evolve(known, hysteresis=found.hysteresis)
    for way in ("forward", "direct"):
        surfaces = (getattr(axis.hysteresis, way).values for axis in (found, known))
        assert np.array_equal(*surfaces)


@pytest.mark.evidence
def test_one_axis_gives_its_report_and_its_model(records: list[Record], tmp_path: Path) -> None:
    bags = {made.name: imported(tmp_path, made, "y") for made in records}
    out = tmp_path / "model.yaml"
    words = [word for name, path in bags.items() for word in (f"--{name}", path)]
    words += ["--out", str(out)]
    result = CliRunner().invoke(identify, words, catch_exceptions=False)
    assert result.exit_code == 0
    assert f"Wrote {out} of y alone" in result.output
    same_as_from_arrays(load_model(out), records, tmp_path / "arrays.yaml")
    report = json.loads(out.with_suffix(".fit.json").read_text("utf-8"))
    assert list(report) == ["y"]
    assert "<!DOCTYPE html>" in out.with_suffix(".fit.html").read_text("utf-8")


@pytest.mark.evidence
def test_each_axis_is_identified_from_whatever_there_is_of_it(
    records: list[Record], tmp_path: Path
) -> None:
    slow, waves, loops = records
    one = imported(tmp_path, slow, "x")
    other = imported(tmp_path, waves, "y")
    out = tmp_path / "model.yaml"
    words = [one, "--frequency", other, str(bag(tmp_path, loops)), "--out", str(out)]
    result = CliRunner().invoke(identify, words, catch_exceptions=False)
    assert result.exit_code == 0
    model = load_model(out)
    assert model.axes == ("x", "y")
    known = {
        (axis, name): status
        for axis, effects in model.effects.items()
        for name, status in effects.each()
    }
    for identified in (
        ("x", "creep"),
        ("x", "hysteresis"),
        ("y", "hysteresis"),
        ("y", "vibration"),
    ):
        assert known[identified].status is Status.IDENTIFIED, identified
    resonance = next(e for e in known["y", "vibration"].intervals if e.name == "resonance")
    near = 2e-6 * RESONANCE  # which the interval of a model's own noise does not hold
    assert resonance.lower - near < RESONANCE < resonance.upper + near
    assert "All records were fitted" in result.output
    report = json.loads(out.with_suffix(".fit.json").read_text("utf-8"))
    assert 0.0 < report["x"]["scan_deviation_over_range"] < 0.01
