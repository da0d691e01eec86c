"""What images of a grating show of a scanner: a table of figures, and a picture."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from afm_scan_ros.core.imaging.grating.models import Positions
from afm_scan_ros.core.imaging.grating.motion import middles
from afm_scan_ros.core.imaging.scan_image import ScanImage
from afm_scan_ros.core.types import Array
from afm_scan_ros.report.style import BLUE, MICRO, ORANGE, blank, styled
from afm_scan_ros.report.table import Row, Table

PERCENT = 100.0
COLUMNS = {
    "image": ("image", ""),
    "axis": ("axis", ""),
    "scale": ("actual over commanded range", ".4f"),
    "nonlinearity_percent": ("deviation from a straight line, % of range rms", ".2f"),
    "apart_pixels": ("trace from retrace, pixels rms", ".2f"),
    "uncertainty_pixels": ("uncertainty of a position, pixels rms", ".3f"),
}


def grating_table(images: Sequence[ScanImage], positions: Sequence[Positions]) -> Table:
    """Return the figures of each image and axis; its picture shows the deviations."""
    rows = [
        row for image, each in zip(images, positions, strict=True) for row in _rows(image, each)
    ]
    title = "What the images show of the scanner"
    return Table("grating", title, COLUMNS, rows, lambda: deviation_figure(images, positions))


def _rows(image: ScanImage, positions: Positions) -> list[Row]:
    rows: list[Row] = []
    for k, (axis, span, count) in enumerate(
        (("x", image.range_x, image.pixels), ("y", image.range_y, image.lines))
    ):
        commanded, moved = 0.5 * span * middles(count), positions.trace[..., k].mean(axis=k)
        slope, offset = np.polyfit(commanded, moved, 1)
        pixel = span / count
        apart = 0.0 if positions.retrace is None else _rms(positions.trace - positions.retrace, k)
        rows.append(
            {
                "image": Path(image.name).name,
                "axis": axis,
                "scale": float(slope),
                "nonlinearity_percent": PERCENT
                * float(np.std(moved - slope * commanded - offset))
                / span,
                "apart_pixels": apart / pixel,
                "uncertainty_pixels": float(np.sqrt(np.mean(positions.uncertainty**2))) / pixel,
            }
        )
    return rows


def _rms(differences: Array, k: int) -> float:
    return float(np.sqrt(np.mean(differences[..., k] ** 2)))


@styled
def deviation_figure(images: Sequence[ScanImage], positions: Sequence[Positions]) -> Figure:
    """Draw how far x and y of each image are from the commanded positions."""
    figure = blank(9.6, 3.2 * len(images))
    panels = figure.subplots(len(images), 2, squeeze=False)
    for (left, right), image, each in zip(panels, images, positions, strict=True):
        sides = ((each.trace, BLUE, "trace"), (each.retrace, ORANGE, "retrace"))
        for moved, colour, name in sides:
            if moved is None:
                continue
            x, y = (
                0.5 * image.range_x * middles(image.pixels),
                0.5 * image.range_y * middles(image.lines),
            )
            deviation_x, deviation_y = (
                moved[..., 0].mean(axis=0) - x,
                moved[..., 1].mean(axis=1) - y,
            )
            left.plot(MICRO * x, MICRO * deviation_x, color=colour, label=name)
            right.plot(MICRO * y, MICRO * deviation_y, color=colour)
        left.set(xlabel="commanded x in µm", ylabel="x less commanded in µm", title=image.name)
        right.set(xlabel="commanded y in µm", ylabel="y less commanded in µm")
    panels[0][0].legend()
    return figure
