"""What a calibration would identify, how its drives grew, and the note with them, as text."""

from collections.abc import Sequence

from afm_scan_ros.core.identification.drives import growth
from afm_scan_ros.core.identification.drives.experiments import EXPERIMENTS
from afm_scan_ros.core.identification.drives.proposal import ProposedRecord
from afm_scan_ros.report.table import Row, Table

SURVEY = "survey"
COLUMNS = {
    "record": ("record", ""),
    "minutes": ("minutes", ".1f"),
    "samples_per_s": ("samples a second", ".6g"),
    "identifies": ("identifies", ""),
}


def plan_table(proposed: Sequence[ProposedRecord]) -> Table:
    """One row a record."""
    total = sum(record.seconds for record in proposed) / 60.0
    rows = [_row(record) for record in proposed]
    return Table("plan", f"Records to take, {total:.1f} minutes together", COLUMNS, rows)


def _row(record: ProposedRecord) -> Row:
    return {
        "record": record.plan.name,
        "minutes": record.seconds / 60.0,
        "samples_per_s": 1.0 / record.plan.sample_period,
        "identifies": _identifies(record),
    }


def _identifies(record: ProposedRecord) -> str:
    words = {
        "resonance": f"the resonance, up to {record.covers:.7g} Hz",
        "hysteresis": f"hysteresis and vibration over {record.covers:.4g} V",
        "creep": f"creep with time constants up to {record.covers:.3g} s",
        "error": f"the model's error, on fresh moves over {record.covers:.4g} V",
    }
    return words[record.identifies]


def export_note(rates: Sequence[tuple[str, float]], axes: Sequence[str]) -> str:
    """``README.md`` for a folder of drives; ``rates`` are names and samples a second."""
    records = "\n".join(f"- `{name}`: {rate:.10g} samples a second" for name, rate in rates)
    commands = "\n".join(_import_command(name, rate, axes) for name, rate in rates)
    return f"""# Drives for a piezoscanner

Each record is a pair of files with the same drive, `NAME.csv` and `NAME.npz`. A row is one sample.
The columns are volts at the scanner's input.

{records}

1. Leave the scanner at 0 V until it rests. Drive it to both limits and back by swings that decay to
   0 V.
2. Give the rows at the rate stated, and take the displacement at the same instants, just before
   each update of the drive.
3. Save drive and displacement as columns in `NAME.measured.csv`. Convert each record to a bag:

   ```bash
{commands}
   ```

4. {_next(rates)}
"""


def _import_command(name: str, rate: float, axes: Sequence[str]) -> str:
    drives = ",".join(f"drive_{axis}={n}:V" for n, axis in enumerate(axes, 1))
    moved = ",".join(f"achieved_{axis}={n}:um" for n, axis in enumerate(axes, 1 + len(axes)))
    kind = "frequency" if name == SURVEY else name
    return (
        f"   afm-scan import-csv {name}.measured.csv --columns {drives},{moved} --skip-rows 1"
        f" --sample-rate {rate!r} --record {kind} --bag {name}"
    )


def _next(rates: Sequence[tuple[str, float]]) -> str:
    if SURVEY in dict(rates):
        return (
            f"Run `afm-scan plan` again with `--have {SURVEY}` and `--have` for each other record."
            " It proposes the records that depend on the resonance."
        )
    if not set(dict(rates)) - set(EXPERIMENTS):
        return (
            "Diagnose the record together with the earlier ones: `afm-scan diagnose --help`. Where"
            " your scanner does not take these voltages, scale and shift them first."
        )
    return "Identify the model: `afm-scan identify --help`."


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
    share = watched.step.share
    what = "record" if watched.step.whole else f"step {number}"
    axes = "; ".join(_axis_text(axis, seen) for axis, seen in watched.responses.items())
    return f"{name}, {what}: {share:.1%} of the plan, {share * planned:.3g} V: {axes}"


def _axis_text(axis: str, seen: growth.MeasuredResponse) -> str:
    return (
        f"{axis} moved {1e6 * seen.travel:.3g} µm, {1e6 * seen.gain:.3g} µm/V, fast peak"
        f" {1e6 * seen.peak:.2g} µm of {1e6 * seen.steady:.2g} µm steady"
    )


def slope_text(name: str, share: float, steepest: float, limit: float) -> str:
    """State that the slew limit (V/s) makes a drive smaller."""
    return (
        f"{name}: planned with {share:.1%} of its voltage, for its slope of {steepest:.3g} V/s is"
        f" beyond the amplifier's {limit:.3g} V/s"
    )


def kept_text(name: str, step: growth.GrowthStep) -> str:
    """State how large the record is, and why it is no larger."""
    if step.reached is None:
        return f"{name}: recorded as planned"
    return f"{name}: recorded with {step.share:.1%} of the planned voltage. {_why(step.reached)}"


def _why(reached: growth.Reached) -> str:
    expected, limit = 1e6 * reached.expected, 1e6 * reached.limit
    at = f"At {reached.share:.1%}"
    if reached.quantity == "travel":
        return f"{at} {reached.axis} would move {expected:.3g} µm, more than {limit:.3g} µm."
    return (
        f"{at} the resonance of {reached.axis} would add {expected:.3g} µm, more than"
        f" {limit:.3g} µm."
    )


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
