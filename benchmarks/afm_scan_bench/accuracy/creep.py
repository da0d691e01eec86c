"""Whether creep drifts when it is stepped hundreds of millions of times."""

import numpy as np

from afm_scan_bench.paper.creep import CREEP_X, CREEP_Y
from afm_scan_ros.core.effects.creep import Creep, CreepModel
from afm_scan_ros.report.table import Row, Table

BLOCK = 1_000_000
SAMPLE_RATES = (20e3, 100e3)
DURATION = 3600.0

COLUMNS = {
    "axis": ("axis", ""),
    "sample_rate_hz": ("sample rate, Hz", ".0f"),
    "samples": ("samples", ".3g"),
    "worst_relative_error": ("worst relative error", ".1e"),
}


def measure() -> Table:
    """Step response over an hour against the analytic one, 1 + Σ gᵢ (1 - exp(-t/τᵢ))."""
    rows: list[Row] = [
        {
            "axis": axis,
            "sample_rate_hz": rate,
            "samples": int(DURATION * rate),
            "worst_relative_error": worst_error(model, rate),
        }
        for axis, model in {"x": CREEP_X, "y": CREEP_Y}.items()
        for rate in SAMPLE_RATES
    ]
    return Table("creep", "Creep: an hour's step response, stepped against analytic", COLUMNS, rows)


def worst_error(model: CreepModel, sample_rate: float) -> float:
    """Largest relative error over the first and last sample of each block of an hour's step."""
    creep = Creep(model, 1.0 / sample_rate)
    state, step = creep.at_rest(), np.ones(BLOCK)
    gains, rates = np.array(model.gains), 1.0 / np.array(model.time_constants)
    worst = 0.0
    for first in range(0, int(DURATION * sample_rate), BLOCK):
        state, response = creep.apply(state, step)
        time = np.array([first, first + BLOCK - 1]) / sample_rate
        exact = 1.0 - np.expm1(-np.outer(time, rates)) @ gains
        worst = max(worst, float(np.max(np.abs(response[[0, -1]] / exact - 1.0))))
    return worst
