"""Models of the default plant from the records that ``afm-scan plan`` proposes, by the hold.

Each scan lasts ten minutes, over 40 µm at one line a second, so that creep counts.
"""

from attrs import evolve

from afm_scan_bench.in_process import record
from afm_scan_bench.scans import ALL, BENCH_SPEC, SEED, default_plant, rms_percent, scan, tracking
from afm_scan_ros.core.identification.drives.proposal import (
    ConverterLimits,
    Coverage,
    coverage,
    of_axes,
    propose,
)
from afm_scan_ros.core.identification.identify import identify_records
from afm_scan_ros.core.model import ScannerModel
from afm_scan_ros.core.record import Record
from afm_scan_ros.core.types import AXES
from afm_scan_ros.report.table import Row, Table

HOLDS = (None, 300.0, 3000.0)
CONVERTER = ConverterLimits(-4.0, 4.0, 50e3)
RANGE = 40e-6
TEN_MINUTES = evolve(
    BENCH_SPEC, range_x=RANGE, range_y=RANGE, line_rate=1.0, lines=600, samples_per_line=10_000
)

COLUMNS = {
    "hold_s": ("creep held for, s", ".0f"),
    "minutes": ("records, minutes", ".1f"),
    "x_percent": ("x, rms, % of range", ".3f"),
    "y_percent": ("y, rms, % of range", ".3f"),
}


def measure() -> Table:
    """Propose, record, identify and scan."""
    rows = [_row(hold) for hold in HOLDS]
    title = "True tracking error of a ten-minute scan, by the models of the records proposed"
    return Table("planned", title, COLUMNS, rows)


def _row(hold: float | None) -> Row:
    minutes, model = planned_model(hold)
    done = tracking(scan(TEN_MINUTES, ALL, model=model))
    x, y = rms_percent(done.x.constant_speed), rms_percent(done.y.trace)
    return {"hold_s": hold or 0.0, "minutes": minutes, "x_percent": x, "y_percent": y}


def planned_model(hold: float | None) -> tuple[float, ScannerModel]:
    """Minutes of record, and the model: a survey first, then what it shows to be lacking."""
    first = propose(CONVERTER, hold, RANGE, Coverage())[0]
    survey = record(first.plan, default_plant(), SEED)
    proposed = propose(CONVERTER, hold, RANGE, _covered(survey))
    plans = [each.plan for each in proposed]
    records = [evolve(record(plan, default_plant(), SEED), kind=plan.name) for plan in plans]
    seconds = first.seconds + sum(each.seconds for each in proposed)
    return seconds / 60.0, identify_records(records).model


def _covered(found: Record) -> Coverage:
    return of_axes([coverage(*found.signals(axis), found.sample_period) for axis in AXES])
