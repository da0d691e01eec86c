"""Figures of hysteresis: fresh records and measured curves."""

import os
from pathlib import Path

import numpy as np
import pytest

from afm_scan_bench.accuracy import hysteresis
from afm_scan_bench.accuracy.fresh_drives import FRESH, LIMIT
from afm_scan_bench.families.operators import LIMIT as LIMIT_OF_PLAYS
from afm_scan_bench.families.operators import applied
from afm_scan_bench.families.scanners import FAMILIES
from afm_scan_bench.measured import forc
from afm_scan_bench.measured.micromag import read_micromag
from afm_scan_bench.measured.recordings import measured_data
from afm_scan_bench.measured.reversal_curve import ReversalCurve
from afm_scan_bench.scans import default_model
from afm_scan_ros.files import share_directory

DATA = Path(os.environ.get("AFM_SCAN_DATA", share_directory() / "../shared/data")) / "forc"


@pytest.mark.parametrize("kind", FRESH)
def test_exact_inverse_on_fresh_records(kind: str) -> None:
    drive = FRESH[kind](np.random.default_rng(7))
    assert np.abs(drive).max() <= LIMIT
    assert drive[0] == pytest.approx(0.0, abs=1e-9)
    for axis, fresh in hysteresis.record(drive).items():
        predicted = hysteresis.predictions(default_model().axis(axis), fresh).values()
        exact, direct = (each - drive for each in predicted)
        found = hysteresis.errors(exact)
        assert found["sigma_percent"] <= 0.06
        assert found["max_percent"] <= 0.2
        assert hysteresis.errors(direct)["sigma_percent"] <= 0.52  # Eq. 18


@pytest.mark.skipif(not DATA.is_dir(), reason=f"no curves at {DATA}: AFM_SCAN_DATA")
def test_measured_curves_are_divided() -> None:
    record = read_micromag(measured_data(forc.RECORD))
    assert (len(record.curves), sum(len(c.inputs) for c in record.curves)) == (152, 30476)
    kept, held_out = forc.divided(forc.freed_curves(record))
    assert (len(kept), len(held_out)) == (122, 30)
    assert len({curve.inputs[-1] for curve in (*kept, *held_out)}) == 1


def curve(turn: float, rng: np.random.Generator) -> ReversalCurve:
    """Curve of plays from a turn (V), in mV, with noise."""
    rise = np.linspace(turn, LIMIT_OF_PLAYS, 60)
    path = np.concatenate([[0.0, LIMIT_OF_PLAYS], rise])
    moved = 1e-6 * applied(FAMILIES["play"], path)[2:] + 1e-9 * rng.standard_normal(len(rise))
    return ReversalCurve(1e3 * rise, moved)


def test_curves_left_out_are_predicted() -> None:
    rng = np.random.default_rng(1)
    curves = [curve(turn * LIMIT_OF_PLAYS, rng) for turn in np.linspace(0.9, -1.0, 25)]
    kept, held_out = forc.divided(curves)
    found = forc.held_out_figures(curves, held_out, forc.predicted(kept, held_out))
    assert found["points"] == 300
    assert float(found["rms_percent"]) < 0.2
