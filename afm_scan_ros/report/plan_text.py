"""What a calibration would identify, how its drives grew, and the note with them, as text."""

from collections.abc import Sequence

from afm_scan_ros.core.identification.drives import growth
from afm_scan_ros.core.identification.drives.experiments import EXPERIMENTS
from afm_scan_ros.core.identification.drives.proposal import ProposedRecord
from afm_scan_ros.report.sentences import sentence
from afm_scan_ros.report.table import Row, Table

SURVEY = "survey"
COLUMNS = {
    "record": ("record", ""),
    "minutes": ("minutes", ".3g"),
    "samples_per_s": ("samples a second", ".6g"),
    "identifies": ("identifies", ""),
}


def plan_table(proposed: Sequence[ProposedRecord]) -> Table:
    """One row a record."""
    total = sum(record.seconds for record in proposed) / 60.0
    rows = [_row(record) for record in proposed]
    return Table("plan", f"Records to take, {total:.3g} minutes together", COLUMNS, rows)


def _row(record: ProposedRecord) -> Row:
    return {
        "record": record.plan.name,
        "minutes": record.seconds / 60.0,
        "samples_per_s": 1.0 / record.plan.sample_period,
        "identifies": sentence(f"plan.{record.identifies}", covers=record.covers),
    }


def export_note(rates: Sequence[tuple[str, float]], axes: Sequence[str]) -> str:
    """``README.md`` for a folder of drives; ``rates`` are names and samples a second."""
    drives = [f"drive_{axis}={n}:V" for n, axis in enumerate(axes, 1)]
    moved = [f"achieved_{axis}={n}:um" for n, axis in enumerate(axes, 1 + len(axes))]
    code = "identify" if set(dict(rates)) - set(EXPERIMENTS) else "diagnose"
    then = sentence("plan.again" if SURVEY in dict(rates) else f"plan.{code}", survey=SURVEY)
    columns = ",".join(drives + moved)
    return sentence("plan.readme", rates=rates, columns=columns, survey=SURVEY, then=then) + "\n"


GROWTH = {
    "record": ("record", ""),
    "percent": ("of the plan, %", ".0f"),
    "drive_v": ("drive, V", ".3g"),
    "travel_x_um": ("x moved, µm", ".3g"),
    "travel_y_um": ("y moved, µm", ".3g"),
    "excitation_um": ("resonance, µm", ".2g"),
    "ended_by": ("ended by", ""),
}


def step_text(name: str, number: int, planned: float, watched: growth.Watched) -> str:
    """One line on a step; ``planned`` is the planned amplitude in V."""
    given = {"step": watched.step, "planned": planned, "responses": watched.responses}
    return sentence("growth.step", name=name, number=number, **given)


def slope_text(name: str, share: float, steepest: float, limit: float) -> str:
    """State that the slew limit (V/s) makes a drive smaller."""
    return sentence("growth.slope", name=name, share=share, steepest=steepest, limit=limit)


def kept_text(name: str, step: growth.GrowthStep) -> str:
    """State how large the record is, and why it is no larger."""
    code = "growth.whole" if step.reached is None else "growth.kept"
    return sentence(code, name=name, share=step.share, reached=step.reached)


def beyond_text(name: str, reached: growth.Reached) -> str:
    """State that a record went beyond a limit that it was to keep."""
    return sentence("growth.beyond", name=name, reached=reached)


def growth_row(name: str, planned: float, last: growth.Watched) -> Row:
    """Row of a record; ``planned`` is its planned amplitude in V."""
    x, y = last.responses["x"], last.responses["y"]
    reached = last.step.reached
    return {
        "record": name,
        "percent": 100.0 * last.step.share,
        "drive_v": last.step.share * planned,
        "travel_x_um": 1e6 * x.travel,
        "travel_y_um": 1e6 * y.travel,
        "excitation_um": 1e6 * max(x.excitation, y.excitation),
        "ended_by": f"{reached.quantity} of {reached.axis}" if reached else "the plan",
    }


def growth_table(rows: Sequence[Row]) -> Table:
    """One row a record."""
    return Table("growth", "Records taken, as large as the response allowed", GROWTH, rows)
