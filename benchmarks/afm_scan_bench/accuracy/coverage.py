"""How often the 95 % intervals that models state hold the truth.

The share of cases is itself uncertain, by the exact binomial interval of Clopper and Pearson
(Biometrika 26, 1934).
"""

import numpy as np
from attrs import frozen
from scipy.stats import beta

from afm_scan_ros.core.model import EffectStatus
from afm_scan_ros.report.table import Row


@frozen
class StatedInterval:
    """The true value of a parameter beside the ends of its interval, in any unit."""

    true: float
    lower: float
    upper: float

    @classmethod
    def of(cls, status: EffectStatus, name: str, true: float) -> "StatedInterval | None":
        """Take what an effect states of a parameter, None where it states nothing."""
        for each in status.intervals:
            if each.name == name:
                lower = 0.0 if each.lower is None else each.lower
                return cls(true, lower, np.inf if each.upper is None else each.upper)
        return None

    @property
    def error(self) -> float:
        """Relative error of the value from which both ends are the same factor away."""
        return float(np.sqrt(self.lower * self.upper)) / self.true - 1.0

    @property
    def half_width(self) -> float:
        """Half of the interval's width over the truth."""
        return 0.5 * (self.upper - self.lower) / self.true

    @property
    def inside(self) -> bool:
        """Whether the interval holds the truth."""
        return bool(self.lower <= self.true <= self.upper)


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
