"""One rising function of one unknown, solved by the secant's steps within bounds."""

import numpy as np

from afm_scan_ros.core.compiled import compiled

EXACT = 1e-13
"""Share of the function's range; what rounding leaves of it."""
ROUNDS = 100
ANY = -np.inf, np.inf


@compiled
def next_try(
    u: float, step: float, tried: tuple[float, float], bounds: tuple[float, float]
) -> float:
    """Return a step's end; where it leaves what is left to try, its middle or the outer bound."""
    there = u + step
    if tried[0] < there < tried[1]:
        return there
    side = 0 if step < 0.0 else 1
    return bounds[side] if tried[side] == bounds[side] else 0.5 * (tried[0] + tried[1])
