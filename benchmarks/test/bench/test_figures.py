"""The figures that the package is held to, on the default plant with the default model."""

import json
from pathlib import Path

import pytest

from afm_scan_bench.accuracy import creep, hold, hysteresis, preview
from afm_scan_bench.accuracy.tracking import row
from afm_scan_bench.curve import TableCurve
from afm_scan_bench.paper.creep import CREEP_Y
from afm_scan_ros.report.table import Table


@pytest.mark.parametrize(
    ("rate", "percent", "better"), [(5.0, 0.3, 10), (30.0, 0.3, 10), (100.0, 0.5, 10)]
)
def test_compensation_follows_the_scan(rate: float, percent: float, better: float) -> None:
    none, every = (float(row(rate, name)["x_rms_percent"]) for name in ("none", "all"))
    assert every <= percent
    assert every * better <= none


def test_over_half_the_resonance_it_still_follows() -> None:
    """250 Hz of 454 Hz, 70 % of each half-period at constant speed."""
    found = row(250.0, "all")
    assert float(found["x_rms_percent"]) <= 1.0
    assert float(found["drive_peak_v"]) <= 4.0


def test_each_inverse_left_out_shows() -> None:
    every = float(row(30.0, "all")["x_rms_percent"])
    for alone in ("creep", "hysteresis", "vibration"):
        assert float(row(30.0, alone)["x_rms_percent"]) > 10.0 * every


def test_creep_does_not_drift_within_an_hour() -> None:
    assert creep.worst_error(CREEP_Y, 20e3) <= 1e-9


def test_the_hold_matters_more_the_slower_the_converter() -> None:
    lost = {
        rate: hold.held_error(rate, hold=False) - hold.held_error(rate, hold=True)
        for rate in hold.SAMPLE_RATES
    }
    assert lost[20e3] > lost[100e3] > 0.0


def test_ten_milliseconds_of_preview_are_enough() -> None:
    by_preview = {r["preview_ms"]: float(r["stream_error"]) for r in preview.measure().rows}
    assert by_preview[10.0] <= 1e-6 < by_preview[1.0]


def test_the_exact_inverse_hysteresis_keeps_to_its_figures_on_a_fresh_record() -> None:
    for found in hysteresis.measure().rows:
        if found["inverse"] == "exact":
            assert float(found["sigma_percent"]) <= 0.1
            assert float(found["max_percent"]) <= 0.3
        else:
            assert float(found["sigma_v"]) <= 0.0416
            assert float(found["max_v"]) <= 0.118


def test_a_table_has_a_machine_readable_twin_and_a_picture(tmp_path: Path) -> None:
    rows = [{"x": 1.0, "y": 2.0}, {"x": 2.0, "y": 4.0}]
    columns = {"x": ("x, V", ".1f"), "y": ("y, m", ".1f")}
    picture = TableCurve("x", "y").picture("A table", columns, rows)
    Table("twin", "A table", columns, rows, picture).save(tmp_path)
    assert json.loads((tmp_path / "twin.json").read_text("utf-8"))["rows"] == rows
    assert (tmp_path / "twin.png").stat().st_size > 0
