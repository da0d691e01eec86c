"""What is left beside what is explained: a formula is not quite the physics, but near it."""

from collections.abc import Sequence

import numpy as np

from afm_scan_ros.core.types import Array

LOUD = 2.5
"""A band's rms over its floor, from which on something is missing in the model."""
REMAINDER, AMISS = 0.02, 30.0
"""Share of the explained misfit that may be left over, a seventh in amplitude; but no band may be
left so many times its floor."""


def too_much(ratios: Sequence[Array], explained: float) -> bool:
    """Whether more is left than where an explanation is one.

    ``ratios``, one array a record, are what is left in each band over its floor; ``explained`` is
    by how much the misfit fell.
    """
    largest = max(float(ratio.max()) for ratio in ratios)
    above = sum(float(np.sum(np.maximum(ratio**2 - 1.0, 0.0))) for ratio in ratios)
    return largest > AMISS or (largest > LOUD and above > REMAINDER * explained)
