"""What follows its input through one time constant; exact where the input is held."""

import numpy as np

from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.types import Array


@compiled
def follow(state: float, wanted: Array, steps: float) -> tuple[float, Array]:
    """State at the end, and its mean in each step (n,); ``steps``: a step in time constants."""
    done = -np.expm1(-steps)
    mean = np.empty_like(wanted)
    for k in range(wanted.size):
        missing = wanted[k] - state
        mean[k] = wanted[k] - missing * done / steps
        state += done * missing
    return state, mean
