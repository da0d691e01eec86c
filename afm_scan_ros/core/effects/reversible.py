"""A hysteresis in two parts: what it would do without loops, and the rest.

F = R(u) + H, with R(u) (V) of the slope that the smallest loops have at u (V), where each loop is
all but closed; Mayergoyz calls it the reversible component. H takes all memory, and equal values
of opposite sign at both saturations.
"""

import numpy as np

from afm_scan_ros.core.effects.hysteresis.everett import EverettSurface
from afm_scan_ros.core.types import Array


def reversible(surface: EverettSurface) -> Array:
    """Return R at the levels of the surface, shape (n,)."""
    rise = 2.0 * np.diag(surface.values, -1)
    levels = np.concatenate(([0.0], np.cumsum(rise)))
    middle = surface.offset + surface.values[-1, 0]
    return np.asarray(middle + levels - 0.5 * levels[-1])


def with_hysteretic_share(surface: EverettSurface, share: float) -> EverettSurface:
    """Return the surface of R + share H; raises InputError where that has no inverse."""
    levels = reversible(surface)
    without = np.tril(0.5 * (levels[:, np.newaxis] - levels))
    values = share * surface.values + (1.0 - share) * without
    offset = share * surface.offset + (1.0 - share) * levels[0]
    return EverettSurface(surface.lower, surface.upper, values, float(offset))
