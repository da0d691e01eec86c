"""A picture of an image as recorded and as corrected: trace, retrace, and their difference."""

from collections.abc import Iterable

import numpy as np
from matplotlib.figure import Figure

from afm_scan_ros.core.types import Array
from afm_scan_ros.features.images.grating.features import levelled
from afm_scan_ros.features.images.scan_image import ScanImage
from afm_scan_ros.report.style import MICRO, NANO, blank, styled

SHOWN = 1.0, 99.0
"""Percentiles of the values at which the colours end, so that a spike does not hide the rest."""
ROWS = "as recorded", "corrected"
COLUMNS = "trace", "retrace", "trace minus retrace"
PANEL = 2.9
"""Width of a panel in inches."""
AROUND = 1.7
"""Height of titles, labels and colour bars in inches."""


@styled
def correction_figure(title: str, before: ScanImage, after: ScanImage) -> Figure:
    """Draw trace, retrace and their difference of an image, before and after its correction.

    The parabola in x and y that fits an image best is subtracted. Both rows have the same colours.
    Both images hold a retrace.
    """
    images = before, after
    height = len(ROWS) * PANEL * before.range_y / before.range_x + AROUND
    figure = blank(9.6, height, title)
    panels = figure.subplots(len(ROWS), len(COLUMNS))
    right, top = (MICRO * max(ends) for ends in zip(*(_ends(i) for i in images), strict=True))
    factor, unit = (NANO, "nm") if before.unit == "m" else (1.0, before.unit)
    rows = [_images(image, factor) for image in images]
    least, most = _percentiles(values for row in rows for values in row[:2])
    widest = _percentiles(np.abs(row[2]) for row in rows)[1]
    colours = [("afmhot", least, most)] * 2 + [("RdBu_r", -widest, widest)]
    shown = []
    for (row, column), panel in np.ndenumerate(panels):
        x, y = _ends(images[row])
        cmap, low, high = colours[column]
        place = {"extent": (0.0, MICRO * x, 0.0, MICRO * y), "origin": "lower"}
        shown.append(panel.imshow(rows[row][column], cmap=cmap, vmin=low, vmax=high, **place))
        panel.set(xlim=(0.0, right), ylim=(0.0, top), xlabel="x in µm", ylabel="y in µm")
        panel.set_title(f"{COLUMNS[column]}, {ROWS[row]}")
        panel.label_outer()
    for drawn, of, what in (
        (shown[0], panels[:, :2], f"{before.channel} without its parabola"),
        (shown[2], panels[:, 2:], "trace minus retrace"),
    ):
        figure.colorbar(
            drawn, ax=of, label=f"{what}, {unit}", location="bottom", extend="both", aspect=30
        )
    return figure


def _ends(image: ScanImage) -> tuple[float, float]:
    return image.range_x, image.range_y


def _images(image: ScanImage, factor: float) -> tuple[Array, Array, Array]:
    trace, retrace = (factor * levelled(np.asarray(v)) for v in (image.trace, image.retrace))
    return trace, retrace, trace - retrace


def _percentiles(values: Iterable[Array]) -> tuple[float, float]:
    low, high = np.percentile(np.concatenate([each.ravel() for each in values]), SHOWN)
    return float(low), float(high)
