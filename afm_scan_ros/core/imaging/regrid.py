"""The image on measured positions: what a lab with a sensor and without compensation would do."""

import numpy as np
from scipy.interpolate import LinearNDInterpolator

from afm_scan_ros.core.types import Array


def regrid(x: Array, y: Array, values: Array, columns: Array, rows: Array) -> Array:
    """Return an image, shape (len(rows), len(columns)), of values read at scattered positions.

    ``x``, ``y`` and ``values`` (n,) are what was measured; ``columns`` and ``rows`` the positions
    of the image's pixels, m. Linear within the Delaunay triangles of the positions, NaN where the
    scanner never was.
    """
    across, along = np.meshgrid(columns, rows)
    found = LinearNDInterpolator(np.column_stack([x, y]), values, rescale=True)
    result: Array = found(across, along)
    return result
