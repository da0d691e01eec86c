"""How fast the core is, beside the least that each of its tasks needs."""

from afm_scan_ros.bench import speed_chain, speed_film, speed_growth, speed_preisach
from afm_scan_ros.bench.ratios import COLUMNS
from afm_scan_ros.bench.table import Table

TURNS = 7


def measure() -> Table:
    """Race inverses, hysteresis, stream and simulated scanner against their yardsticks."""
    rows = [
        *speed_chain.rows(samples=10**7, streamed=10**6, turns=TURNS),
        *speed_preisach.rows(samples=10**6, relayed=5000, turns=TURNS),
        *speed_film.rows(samples=10**5, turns=TURNS),
        *speed_growth.rows(lengths=(10**5, 10**6, 10**7, 10**8), loops=10**5, turns=3 * TURNS),
    ]
    return Table(
        "speed", "Speed of the core, each figure as a ratio taken in this run", COLUMNS, rows
    )
