"""How often an effect is named whose mechanism nobody looked at while diagnosis was made."""

from afm_scan_bench.diagnosis.diagnosis import SHARING, table
from afm_scan_bench.diagnosis.unmodelled.cases import OTHER_KINDS, effect_cases
from afm_scan_bench.diagnosis.unmodelled.runs import outcomes
from afm_scan_ros.report.table import Table
from afm_scan_ros.simulation.mechanisms.seventh_sizes import SEVENTH


def measure() -> Table:
    """Trace every kept kind of mechanism at every size, each three on a scanner of their own."""
    every = tuple((name,) for name in SEVENTH)
    return table("diagnosis_kinds", outcomes(effect_cases(OTHER_KINDS, SHARING, every)))
