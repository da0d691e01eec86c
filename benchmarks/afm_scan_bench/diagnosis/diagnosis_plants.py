"""How often the diagnosis names the right effect, and the errors with the extended model."""

import math
from collections.abc import Sequence
from functools import partial

from afm_scan_bench.diagnosis.unmodelled.cases import effect_cases
from afm_scan_bench.diagnosis.unmodelled.figure import OUTSIDE, diagnosis_figure
from afm_scan_bench.diagnosis.unmodelled.runs import UnmodelledOutcome, outcomes
from afm_scan_bench.diagnosis.unmodelled.sets import HELD_OUT_PLANTS
from afm_scan_bench.diagnosis.unmodelled.summary import summary
from afm_scan_ros.report.table import Row, Table

SHARING = 3
"""Cases of a size that share one scanner and its model."""

COLUMNS = {
    "effects": ("effect", ""),
    "size": ("size", ""),
    "plant": ("plant", "d"),
    "line_rate_hz": ("Hz", "g"),
    "lines": ("lines", "d"),
    "effect_nm": ("effect, nm", ".0f"),
    "ratio": ("ratio", ".1f"),
    "stated": ("stated", ""),
    "answer": ("answer", ""),
    "residual": ("residual", ".2f"),
    "tracking": ("tracking", ".2f"),
    "worst": ("worst", ".2f"),
    "seconds": ("s", ".0f"),
}


def measure() -> Table:
    """Diagnose every effect and pair at every size, on the held-out plants."""
    return table("diagnosis_plants", outcomes(effect_cases(HELD_OUT_PLANTS, SHARING)))


def table(name: str, found: Sequence[UnmodelledOutcome]) -> Table:
    """Return a row for each case, with their summary in the title.

    Residual and tracking error are those with the extended model, over the healthy scanner's with
    its own; ``worst`` is the largest error after over that before, on other scans.
    """
    rows = [_row(outcome) for outcome in found]
    picture = partial(diagnosis_figure, rows)
    return Table(name, summary(found), COLUMNS, rows, picture=picture)


def _row(outcome: UnmodelledOutcome) -> Row:
    case, size, after = outcome.case, outcome.size, outcome.repeated
    return {
        "effects": " + ".join(case.effects),
        "truth": " + ".join(sorted(name or OUTSIDE for name in case.truth)),
        "size": case.size,
        "plant": case.plant,
        "scan_seed": case.seed,
        "noise": case.noise,
        "line_rate_hz": case.spec.line_rate,
        "lines": case.spec.lines,
        "effect_nm": 1e9 * size.added if size else math.nan,
        "ratio": size.ratio if size else math.nan,
        "stated_at_first": outcome.statements[0].text,
        "experiment": ", ".join(outcome.experiments),
        "stated": outcome.statements[-1].text,
        "answer": outcome.answer,
        "residual_before": after.residual_before if after else math.nan,
        "residual": after.residual if after else math.nan,
        "tracking_before": after.tracking_before if after else math.nan,
        "tracking": after.tracking if after else math.nan,
        "worst": after.worst if after else math.nan,
        "refused": ", ".join(after.refused) if after else "",
        "parameters": "; ".join(
            f"{p.name} {p.found:.6g} ± {p.halfwidth:.2g} (true {p.true:.6g})"
            for p in outcome.parameters
        ),
        "seconds": outcome.seconds,
    }
