"""Compensation is best where the scanner is as its model."""

import json
from pathlib import Path

import pytest
from attrs import evolve

from afm_scan_bench.accuracy.robustness import errors
from afm_scan_bench.curve import TableCurve
from afm_scan_bench.detune import detuned, with_creep_rate
from afm_scan_bench.scans import default_plant, spec_at
from afm_scan_ros.report.table import Table

FAST = spec_at(100.0)


def rms(**plant: float) -> float:
    """Error at 100 Hz of a plant whose frequency, damping or creep rate is off by a factor."""
    factors = {"frequency": 1.0, "damping": 1.0, "creep": 1.0} | plant
    changed = detuned(default_plant(), factors["frequency"], factors["damping"])
    found = errors(FAST, with_creep_rate(changed, factors["creep"]))
    return float(found["x_rms_percent"])


@pytest.mark.parametrize("thing", ["frequency", "damping", "creep"])
def test_error_grows_with_the_mismatch(thing: str) -> None:
    near, far = (0.99, 0.95) if thing == "frequency" else (0.8, 0.5)
    assert rms() < rms(**{thing: far})
    assert rms(**{thing: near}) < rms(**{thing: far})


def test_a_percent_of_resonance_costs_more_than_of_damping_or_creep() -> None:
    assert rms(frequency=1.03) > 3.0 * max(rms(damping=1.03), rms(creep=1.03))


@pytest.mark.parametrize("range_um", [10.0, 50.0])
def test_other_ranges_than_that_of_the_figures(range_um: float) -> None:
    assert float(errors(evolve(FAST, range_x=1e-6 * range_um))["x_rms_percent"]) <= 0.5


def test_a_picture_has_a_panel_for_each_study(tmp_path: Path) -> None:
    rows = [{"x": 1.0, "y": 2.0, "p": p, "by": b} for p in ("a", "b", "c") for b in ("d", "e")]
    columns = {"x": ("x", "g"), "y": ("y", "g"), "p": ("p", ""), "by": ("by", "")}
    curve = TableCurve("x", "y", by="by", panel="p")
    Table("panels", "A table", columns, rows, curve.picture("A table", columns, rows)).save(
        tmp_path
    )
    assert json.loads((tmp_path / "panels.json").read_text("utf-8"))["rows"] == rows
    assert (tmp_path / "panels.png").stat().st_size > 0
