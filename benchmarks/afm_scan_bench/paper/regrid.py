"""The image at the measured positions, as for a scanner with a sensor and no compensation."""

import numpy as np

from afm_scan_ros.core.types import Array


def regrid(x: Array, y: Array, values: Array, columns: Array, rows: Array, reach: float) -> Array:
    """Return an image, shape (len(rows), len(columns)), of values read along measured lines.

    ``x``, ``y`` (m) and ``values`` have a row for each line, its samples in any order; ``columns``
    and ``rows`` are the positions of the image's pixels, m. Linear along the lines and then between
    them; NaN further than half a pixel beyond the lines, and between lines that lie more than
    ``reach`` (m) apart.
    """
    lines = [_along(*line, columns) for line in zip(x, y, values, strict=True)]
    places, heights = (np.stack(part) for part in zip(*lines, strict=True))
    image = [_between(*column, rows, reach) for column in zip(places.T, heights.T, strict=True)]
    return np.column_stack(image)


def _along(x: Array, y: Array, values: Array, columns: Array) -> tuple[Array, Array]:
    """Return y and value of one line at each column, NaN where it never came."""
    order = np.argsort(x)
    place, height = (
        np.interp(columns, x[order], signal[order], left=np.nan, right=np.nan)
        for signal in (y, values)
    )
    return place, height


def _between(places: Array, heights: Array, rows: Array, reach: float) -> Array:
    """Return one column's values at each row, from those of the lines that came there."""
    there = np.isfinite(places)
    order = np.argsort(places[there])
    y, h = places[there][order], heights[there][order]
    if len(y) < 2:  # noqa: PLR2004 - nothing lies between fewer
        return np.full(len(rows), np.nan)
    within = np.clip(rows, y[0], y[-1])
    above = np.clip(np.searchsorted(y, rows), 1, len(y) - 1)
    nearby = np.abs(within - rows) < 0.5 * abs(rows[1] - rows[0])  # a pixel has a height too
    drawn = nearby & (y[above] - y[above - 1] <= reach)
    return np.where(drawn, np.interp(within, y, h), np.nan)
