"""A Preisach surface as plays, each with a curve of its own.

T_r (V) is what the Everett surface has in its diagonal of cells of the threshold r (V). One
triangle of each cell on the main diagonal has loops smaller than the grid tells, and half of what
the next diagonal has.
"""

import numpy as np

from afm_scan_ros.core.effects.hysteresis.everett import EverettSurface
from afm_scan_ros.core.types import Array

SMALLEST = 1.0 / 6.0  # cells, threshold of the loops within one: their centre of gravity


def curves(surface: EverettSurface) -> tuple[Array, Array]:
    """Thresholds in cells (n,), and each play's T (V) at cell after cell of its way (n, n + 1)."""
    falls = 2.0 * surface.values
    masses = falls[1:, :-1] - falls[:-1, :-1] - falls[1:, 1:] + falls[:-1, 1:]
    count = len(masses)
    thresholds, result = 0.5 * np.arange(float(count)), np.zeros((count, count + 1))
    thresholds[0] = SMALLEST
    for k in range(1, count):
        result[k, 1 : count - k + 1] = np.cumsum(np.diag(masses, -k))
    next_to = np.diag(masses, -1)
    result[0, 1:] = 0.5 * np.cumsum(np.interp(np.arange(count), np.arange(1, count) - 0.5, next_to))
    return thresholds, result
