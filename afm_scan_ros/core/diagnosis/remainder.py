"""What is left beside what is explained: a formula is not quite the physics, but near it.

It is near in the bands in which it explains, and no excuse for what is left in others: what a
drift's formula leaves is slow, and not at the line rate.
"""

from collections.abc import Sequence

import numpy as np

from afm_scan_ros.core.types import Array

LOUD = 2.5
"""A band's rms over its floor, from which on something is missing in the model."""
REMAINDER, AMISS = 0.02, 30.0
"""Share of what is explained in a band that may be left over there, a seventh in amplitude; but no
band may be left so many times its floor."""


def lowered(before: Sequence[Array], after: Sequence[Array]) -> Array:
    """By how much the mean square fell in each band of each record, where it did.

    ``before`` and ``after``, one array a record, are the residual's rms over the floor by band.
    """
    fell = np.concatenate(before) ** 2 - np.concatenate(after) ** 2
    return np.asarray(np.maximum(fell, 0.0))


def too_much(before: Sequence[Array], after: Sequence[Array]) -> bool:
    """Whether more is left ``after`` an explanation than where it is one; both as above."""
    left = np.concatenate(after)
    excused = left**2 - 1.0 <= REMAINDER * lowered(before, after)
    return bool(np.any((left > AMISS) | ((left > LOUD) & ~excused)))
