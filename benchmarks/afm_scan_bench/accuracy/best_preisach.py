"""Prediction of a fresh scan against the best that a scanner's family allows a Preisach model.

The best model is identified from records without noise, of twice as many reversal curves. The drive
is known, and both predict the displacement by it.
"""

from collections.abc import Iterator

import numpy as np
from attrs import evolve

from afm_scan_bench.families.scanners import FamilyScanner
from afm_scan_bench.scans import spec_at
from afm_scan_ros.core.identification.drives.excitation import PLANS, hysteresis_plan
from afm_scan_ros.core.identification.identify import identify_axis
from afm_scan_ros.core.metrics import Scan
from afm_scan_ros.core.model import AxisModel, ScannerModel
from afm_scan_ros.core.scanner import predict
from afm_scan_ros.report.table import Row, Table

FAMILIES, MAPS = ("play", "slip", "preisach"), ("none", "square before, cube behind")
SHARES, RATE, LEVELS = (0.2, 0.4, 0.9), 5.0, 121

COLUMNS = {
    "family": ("family", ""),
    "maps": ("maps", ""),
    "share_percent": ("% of range", ".0f"),
    "model_nm": ("model, nm rms", ".2f"),
    "best_nm": ("best Preisach model", ".2f"),
    "ratio": ("ratio", ".2f"),
}


def measure() -> Table:
    """Identify both models of each scanner, and predict scans of three sizes."""
    rows = [row for family in FAMILIES for maps in MAPS for row in rows_of(family, maps)]
    title = "Prediction of x in a fresh scan, against the best Preisach model"
    return Table("best_preisach", title, COLUMNS, rows)


def rows_of(family: str, maps: str) -> Iterator[Row]:
    """Errors of prediction on one scanner."""
    scanner = FamilyScanner.of(family, maps)
    model = identify_axis(*scanner.records().values()).model
    dense = {**PLANS, "hysteresis": lambda: hysteresis_plan(levels=LEVELS)}
    best = identify_axis(*scanner.records(plans=dense, exact=True).values()).model
    for share in SHARES:
        extent = share * scanner.reach()
        done = scanner.scan(evolve(spec_at(RATE), range_x=extent, range_y=extent), model)
        errors = {"model_nm": _residual(done, model), "best_nm": _residual(done, best)}
        ratio = errors["model_nm"] / errors["best_nm"]
        yield {
            "family": family,
            "maps": maps,
            "share_percent": 100.0 * share,
            **errors,
            "ratio": ratio,
        }


def _residual(done: Scan, model: AxisModel) -> float:
    """Rms of a prediction's residual in x, its mean removed, nm."""
    return 1e9 * float(np.std(predict(ScannerModel(model), done.drive).x - done.true.x))
