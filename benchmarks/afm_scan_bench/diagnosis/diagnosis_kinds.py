"""How often an effect is named whose mechanism is held out."""

from afm_scan_bench.diagnosis.diagnosis_plants import SHARING, table
from afm_scan_bench.diagnosis.unmodelled.cases import effect_cases
from afm_scan_bench.diagnosis.unmodelled.runs import outcomes
from afm_scan_bench.diagnosis.unmodelled.sets import HELD_OUT_MECHANISM_PLANTS, HELD_OUT_MECHANISMS
from afm_scan_ros.report.table import Table


def measure() -> Table:
    """Diagnose every held-out mechanism at every size, three to a scanner of their own."""
    every = tuple((name,) for name in HELD_OUT_MECHANISMS)
    cases = effect_cases(HELD_OUT_MECHANISM_PLANTS, SHARING, every)
    return table("diagnosis_kinds", outcomes(cases))
