"""How often an effect is found where there is none."""

from collections.abc import Sequence

from afm_scan_bench.diagnosis.unmodelled.cases import healthy_cases
from afm_scan_bench.diagnosis.unmodelled.judge import CORRECT
from afm_scan_bench.diagnosis.unmodelled.runs import UnmodelledOutcome, outcomes
from afm_scan_bench.diagnosis.unmodelled.sets import HELD_OUT_PLANTS
from afm_scan_bench.diagnosis.unmodelled.summary import counted
from afm_scan_ros.core.diagnosis.axis_diagnosis import FOUND
from afm_scan_ros.report.table import Row, Table

PLANTS, SCANS = 20, 25

COLUMNS = {
    "plant": ("plant", "d"),
    "noise": ("noise", "g"),
    "scans": ("scans", "d"),
    "found": ("effect found", "d"),
    "other": ("other than sufficient", "d"),
    "seconds": ("s a scan", ".1f"),
    "stated": ("stated", ""),
}


def measure() -> Table:
    """Diagnose 25 scans of each of 20 healthy scanners, each with its own model."""
    return table(outcomes(healthy_cases(range(HELD_OUT_PLANTS, HELD_OUT_PLANTS + PLANTS), SCANS)))


def table(found: Sequence[UnmodelledOutcome]) -> Table:
    """Return a row for each scanner, with their summary in the title."""
    by_plant: dict[int, list[UnmodelledOutcome]] = {}
    for outcome in found:
        by_plant.setdefault(outcome.case.plant, []).append(outcome)
    false = sum(_found(outcome) for outcome in found)
    title = (
        f"Scans of scanners without an effect, drawn by seeds {min(by_plant)} to {max(by_plant)}\n"
        + counted("effect found on a healthy scanner", false, len(found))
    )
    rows = [_row(plant, some) for plant, some in by_plant.items()]
    return Table("diagnosis_healthy", title, COLUMNS, rows)


def _row(plant: int, found: Sequence[UnmodelledOutcome]) -> Row:
    other = [outcome for outcome in found if outcome.answer != CORRECT]
    return {
        "plant": plant,
        "noise": found[0].case.noise,
        "scans": len(found),
        "found": sum(_found(outcome) for outcome in found),
        "other": len(other),
        "seconds": sum(outcome.seconds for outcome in found) / len(found),
        "stated": "; ".join(
            f"{o.statements[0].text} ({o.case.spec.pattern}, {o.case.spec.line_rate:g} Hz,"
            f" {1e6 * o.case.spec.range_x:.0f} µm)"
            for o in other
        ),
    }


def _found(outcome: UnmodelledOutcome) -> bool:
    """Whether an effect was stated with confidence, at first or after an experiment."""
    return any(statements.verdict == FOUND for statements in outcome.statements)
