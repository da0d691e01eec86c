"""How often what is fitted to a noisy record holds the truth within its 95 % interval.

Each effect's own simulation is fitted seed by seed; the share of seeds is itself uncertain, by the
exact binomial interval of Clopper and Pearson (Biometrika 26, 1934).
"""

from collections.abc import Callable, Iterable

from scipy.stats import beta

from afm_scan_bench.accuracy.intervals import creep, hysteresis, vibration
from afm_scan_ros.report.table import Row, Table

SEEDS = 200
EFFECTS: tuple[Callable[[Iterable[int]], list[Row]], ...] = (
    creep.coverage,
    vibration.coverage,
    hysteresis.coverage,
)
"""Each gives a row for each of its parameters."""

COLUMNS = {
    "effect": ("effect", ""),
    "parameter": ("parameter", ""),
    "true": ("true", ".5g"),
    "half_width": ("± (95 %)", ".2g"),
    "unit": ("unit", ""),
    "seeds": ("seeds", "d"),
    "inside_percent": ("inside, %", ".1f"),
    "lowest_percent": ("at least, %", ".1f"),
    "highest_percent": ("at most, %", ".1f"),
}


def measure() -> Table:
    """Fit 200 records of each effect, their noise differing."""
    rows = [with_bounds(row) for effect in EFFECTS for row in effect(range(SEEDS))]
    title = "Records whose 95 % interval holds the truth, and 95 % bounds of that share"
    return Table("coverage", title, COLUMNS, rows)


def with_bounds(row: Row) -> Row:
    """Return the row with the bounds of its share, %."""
    seeds = int(row["seeds"])
    inside = round(float(row["inside_percent"]) / 100.0 * seeds)
    low, high = clopper_pearson(inside, seeds)
    return {**row, "lowest_percent": 100.0 * low, "highest_percent": 100.0 * high}


def clopper_pearson(inside: int, of: int) -> tuple[float, float]:
    """95 % bounds of a probability that came true ``inside`` times ``of`` as many."""
    low = beta.ppf(0.025, inside, of - inside + 1) if inside else 0.0
    high = beta.ppf(0.975, inside + 1, of - inside) if inside < of else 1.0
    return float(low), float(high)
