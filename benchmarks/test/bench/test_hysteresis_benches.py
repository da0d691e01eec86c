"""Figures of hysteresis: fresh records, ramps, intervals, measured curves."""

import os
from pathlib import Path

import numpy as np
import pytest

from afm_scan_bench.accuracy import hysteresis
from afm_scan_bench.accuracy.fresh_drives import FRESH, LIMIT
from afm_scan_bench.accuracy.intervals.hysteresis import coverage
from afm_scan_bench.accuracy.ramp_rate import rows_at
from afm_scan_bench.measured import forc
from afm_scan_bench.measured.micromag import read_micromag
from afm_scan_bench.measured.recordings import measured_data
from afm_scan_bench.scans import default_model
from afm_scan_ros.files import share_directory

DATA = Path(os.environ.get("AFM_SCAN_DATA", share_directory() / "../shared/data")) / "forc"


@pytest.mark.parametrize("kind", FRESH)
def test_exact_inverse_on_fresh_records(kind: str) -> None:
    drive = FRESH[kind](np.random.default_rng(7))
    assert np.abs(drive).max() <= LIMIT
    assert drive[0] == pytest.approx(0.0, abs=1e-9)
    for axis, fresh in hysteresis.record(drive).items():
        exact, direct = hysteresis.predictions(default_model().axis(axis), fresh).values()
        found = hysteresis.errors(exact - fresh.drive)
        assert found["sigma_percent"] <= 0.06
        assert found["max_percent"] <= 0.2
        assert hysteresis.errors(direct - fresh.drive)["sigma_percent"] <= 0.52  # Eq. 18


@pytest.mark.parametrize("rate", [10.0, 300.0])
def test_only_the_freed_record_shows_the_loop_that_no_rate_changes(rate: float) -> None:
    for row in rows_at(rate):
        static = float(row["static"])
        assert abs(float(row["as_recorded"]) - static) > 1.0
        assert float(row["without_all"]) == pytest.approx(static, abs=0.05)


def test_intervals_hold_the_truth_about_as_often_as_stated() -> None:
    """12 seeds of five values: 60 draws, of which 95 % means at least 50 all but surely."""
    rows = coverage(range(12))
    assert np.mean([float(row["inside_percent"]) for row in rows]) > 100.0 * 50.0 / 60.0


@pytest.mark.skipif(not DATA.is_dir(), reason=f"no curves at {DATA}: AFM_SCAN_DATA")
def test_measured_curves_left_out_are_predicted() -> None:
    record = read_micromag(measured_data(forc.RECORD))
    assert (len(record.curves), sum(len(c.inputs) for c in record.curves)) == (152, 30476)
    found = forc.held_out_figures(forc.freed_curves(record), 101)
    assert float(found["rms_percent"]) < 0.05
    assert float(found["over_noise"]) < 2.0
