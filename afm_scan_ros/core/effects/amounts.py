"""How much of a known shape a residual holds: where to begin a fit."""

import numpy as np

from afm_scan_ros.core.types import Array


def amounts(residual: Array, *shapes: Array) -> Array:
    """Least-squares amount of each shape (n,) in a residual (n,), an offset apart.

    A shape that never changes gets 0.
    """
    centred = np.stack([shape - shape.mean() for shape in shapes], axis=1)
    size = np.linalg.norm(centred, axis=0)
    size[size == 0.0] = 1.0
    found, *_ = np.linalg.lstsq(centred / size, residual - residual.mean(), rcond=None)
    return np.asarray(found / size)
