"""How a drive grew while it was watched, as text and as a table."""

from collections.abc import Sequence

from afm_scan_ros.core.identification.drives.growth import GrowthStep, Reached, Response, Watched
from afm_scan_ros.report.table import Row, Table

COLUMNS = {
    "record": ("record", ""),
    "percent": ("of the plan, %", ".0f"),
    "drive_v": ("drive, V", ".3g"),
    "travel_x_um": ("x moved, µm", ".3g"),
    "travel_y_um": ("y moved, µm", ".3g"),
    "excitation_um": ("resonance, µm", ".2g"),
    "ended_by": ("ended by", ""),
}


def step_text(name: str, number: int, planned: float, watched: Watched) -> str:
    """One line on a step; ``planned`` is the planned amplitude in V."""
    share = watched.step.share
    what = "record" if watched.step.whole else f"step {number}"
    axes = "; ".join(_axis_text(axis, seen) for axis, seen in watched.responses.items())
    return f"{name}, {what}: {share:.1%} of the plan, {share * planned:.3g} V: {axes}"


def _axis_text(axis: str, seen: Response) -> str:
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


def kept_text(name: str, step: GrowthStep) -> str:
    """State how large the record is, and why it is no larger."""
    if step.reached is None:
        return f"{name}: recorded as planned"
    return f"{name}: recorded with {step.share:.1%} of the planned voltage. {_why(step.reached)}"


def _why(reached: Reached) -> str:
    expected, limit = 1e6 * reached.expected, 1e6 * reached.limit
    at = f"At {reached.share:.1%}"
    if reached.quantity == "travel":
        return f"{at} {reached.axis} would move {expected:.3g} µm, more than {limit:.3g} µm."
    return (
        f"{at} the resonance of {reached.axis} would add {expected:.3g} µm, more than"
        f" {limit:.3g} µm."
    )


def growth_row(name: str, planned: float, last: Watched) -> Row:
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
    return Table("growth", "Records taken, as large as the response allowed", COLUMNS, rows)
