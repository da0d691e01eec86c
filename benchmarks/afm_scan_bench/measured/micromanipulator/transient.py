"""End of the initial transient in a record of a periodic drive."""

import numpy as np

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import Array

ALIKE = 1.5
"""Rms difference of two periods, over the usual one, up to which they count as alike."""
FEWEST = 4
"""Least number of periods for the median."""


def end_of_transient(displacement: Array, period: int) -> int:
    """First sample of the first period that the next one repeats as well as is usual.

    ``displacement`` has shape (n,), ``period`` is in samples. The mean of each period is removed,
    so that drift does not count; usual is the median over all neighbours. Raises InputError for
    fewer than four periods.
    """
    count = len(displacement) // period
    if count < FEWEST:
        raise InputError(
            f"a record of {len(displacement)} samples holds {count} periods of {period}: too few"
            f" to tell a transient from them; record {FEWEST} or more"
        )
    shapes = displacement[: count * period].reshape(count, period)
    shapes = shapes - shapes.mean(axis=1, keepdims=True)
    change = np.sqrt(np.mean(np.diff(shapes, axis=0) ** 2, axis=1))
    return period * int(np.argmax(change <= ALIKE * np.median(change)))
