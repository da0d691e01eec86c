"""How long a step must be held to determine the slowest element of creep, on the default plant.

Creep is fitted to records of different lengths as 'afm-scan identify' fits it, order and all. A
short record knows neither gain nor time constant of an element slower than itself, only their
ratio: a steady drift.
"""

from collections.abc import Iterator

import numpy as np

from afm_scan_bench.in_process import record
from afm_scan_bench.scans import SEED, default_plant
from afm_scan_ros.core.identification.creep.fit import VAGUE, fit_creep, half_width
from afm_scan_ros.core.identification.drives.excitation import creep_plan
from afm_scan_ros.core.types import AXES
from afm_scan_ros.report.table import Row, Table

HOLDS = (120.0, 300.0, 600.0, 1800.0, 3000.0)

COLUMNS = {
    "axis": ("axis", ""),
    "hold_s": ("held for, s", ".0f"),
    "order": ("order", "d"),
    "gain": ("slowest: gain", ".4f"),
    "gain_percent": ("± %", ">"),
    "time_constant_s": ("time constant, s", ".1f"),
    "time_constant_percent": ("± %", ">"),
    "determined": ("determined", ""),
}


def measure() -> Table:
    """Step both axes, hold, and see how well the slowest element is known (95 %)."""
    rows = [row for hold in HOLDS for row in _rows(hold)]
    title = "Creep: the slowest element, by how long the step is held"
    rows.sort(key=lambda row: str(row["axis"]))
    return Table("record_length", title, COLUMNS, rows)


def _rows(hold: float) -> Iterator[Row]:
    plan = creep_plan((hold,))
    seen = record(plan, default_plant(), SEED)
    for axis in AXES:
        fit = fit_creep(*seen.signals(axis), plan.sample_period)
        gain, tau = fit.model.gains[-1], fit.model.time_constants[-1]
        gains = half_width(gain, fit.intervals[f"gain_{fit.order}"])
        taus = half_width(tau, fit.intervals[f"time_constant_{fit.order}"])
        yield {
            "axis": axis,
            "hold_s": hold,
            "order": fit.order,
            "gain": gain,
            "gain_percent": _percent(gains),
            "time_constant_s": tau,
            "time_constant_percent": _percent(taus),
            "determined": "yes" if max(gains, taus) <= VAGUE else "no",
        }


def _percent(share: float) -> str:
    return f"{100.0 * share:.2f}" if np.isfinite(share) else "open"
