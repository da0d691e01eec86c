"""How fast the core is, beside the least that each of its tasks needs."""

from afm_scan_bench.speed.timing import chain, growth, preisach
from afm_scan_bench.speed.timing.ratios import COLUMNS
from afm_scan_ros.report.table import Table

TURNS = 7


def measure() -> Table:
    """Race inverses, hysteresis, stream and simulated scanner against their yardsticks."""
    rows = [
        *chain.rows(samples=10**7, streamed=10**6, turns=TURNS),
        *preisach.rows(samples=10**6, relayed=5000, turns=TURNS),
        *growth.rows(lengths=(10**5, 10**6, 10**7, 10**8), loops=10**5, turns=3 * TURNS),
    ]
    return Table(
        "speed", "Speed of the core, each figure as a ratio taken in this run", COLUMNS, rows
    )
