"""What images of a grating show of a scanner: a table of figures, and pictures."""

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from afm_scan_ros.core.model import BaseEffects, Status
from afm_scan_ros.core.types import AXES, Array
from afm_scan_ros.features.images.grating.features import levelled
from afm_scan_ros.features.images.grating.models import APART, Positions
from afm_scan_ros.features.images.grating.motion import middles
from afm_scan_ros.features.images.grating.registered_image import ImageQuantity
from afm_scan_ros.features.images.grating.rough_motion import FINEST
from afm_scan_ros.features.images.scan_image import ScanImage
from afm_scan_ros.report.style import BLUE, MICRO, NANO, ORANGE, blank, styled, zero_line
from afm_scan_ros.report.table import Row, Table

COLUMNS = {
    "image": ("image", ""),
    "axis": ("axis", ""),
    "figure": ("figure", ""),
    "value": ("value", ".4f"),
    "lower": ("95 % from", ".4f"),
    "upper": ("to", ".4f"),
    "unit": ("unit", ""),
}
FASTER = 10.0
"""Line rate to record next over that of the images."""
TOGETHER = "upwards and downwards"
MEANS = {"x": "lines", "y": "pixels of a line"}
"""What the motion of an axis is the mean over."""
SHOWN = 1.0, 99.0
"""Percentiles of the values at which the colours end, so that a spike does not hide the rest."""
ROWS = "as recorded", "corrected"
SIDES = "trace", "retrace", "trace minus retrace"
PANEL = 2.9
"""Width of a panel in inches."""
AROUND = 1.7
"""Height of titles, labels and colour bars in inches."""


def grating_table(
    images: Sequence[ScanImage],
    positions: Sequence[Positions],
    figures: Sequence[Sequence[ImageQuantity]],
    drift: Sequence[ImageQuantity],
    refused: Sequence[str],
) -> Table:
    """Return the figures of each image, and of both directions; its picture shows deviations.

    Lengths in % are of the commanded range. The title names each image that was ``refused``, and
    why.
    """
    names = [Path(image.name).name for image in images]
    pairs = [*zip(names, figures, strict=True), (TOGETHER, drift)]
    rows = [_row(name, each) for name, every in pairs for each in every]
    title = "What the images show of the scanner"
    if refused:
        title += f" (not used: {'; '.join(refused)})"
    return Table("grating", title, COLUMNS, rows, lambda: deviation_figure(images, positions))


def _row(image: str, figure: ImageQuantity) -> Row:
    return {
        "image": image,
        "axis": figure.axis,
        "figure": figure.name,
        "value": figure.value,
        "lower": figure.lower,
        "upper": figure.upper,
        "unit": figure.unit,
    }


def left_out(images: Sequence[ScanImage], positions: Sequence[Positions]) -> Iterator[str]:
    """Yield which lines of each image are not known, beside the one scanned first."""
    for image, found in zip(images, positions, strict=True):
        count = image.lines - len(found.trace[found.known])
        if count > 1:
            yield (
                f"{Path(image.name).name}: no edge shows y in the {count} lines scanned first, just"
                " after y turned. Corrected images leave them out."
            )


def not_separated(images: Sequence[ScanImage], x: BaseEffects) -> Iterator[str]:
    """Yield what the images cannot separate, and the image to record next."""
    rates = [1.0 / image.line_time for image in images if image.line_time]
    slowest, fastest = min(rates), max(rates)
    if fastest < APART * slowest:
        yield (
            f"x: at {fastest:.3g} Hz alone, creep, lag and hysteresis look alike. The model holds"
            f" at this rate. Record the same image at {FASTER * fastest:.3g} Hz."
        )
    elif x.vibration.status is Status.UNKNOWN:
        yield (
            f"x: no ripple of a resonance shows up to {fastest:.3g} Hz. One above"
            f" {max(map(_followed, images)):.3g} Hz would be finer than the motion is followed, so"
            " the model has none and holds at these rates. Record a faster image to scan faster."
        )
    elif x.creep.status is Status.UNKNOWN:
        yield "x: the line rates show no creep. The model holds between them."
    if len({image.range_x for image in images}) == 1:
        yield ("x: smaller loops are not shown. Record an image of half the size to know them.")
    if len({image.upward for image in images}) == 1:
        way = "downwards" if images[0].upward else "upwards"
        yield f"y: scale and drift look alike in one direction. Record one {way}."
    yield "y: creep and hysteresis look alike in images, so y is a gain alone."


def _followed(image: ScanImage) -> float:
    """Frequency (Hz) of the finest ripple that is sought in an image."""
    pixel = 0.5 * (image.line_time or np.inf) / (image.pixels * (1.0 + 2.0 * image.overscan))
    return 1.0 / (FINEST * pixel)


@styled
def deviation_figure(images: Sequence[ScanImage], positions: Sequence[Positions]) -> Figure:
    """Draw how far x and y of each image are from the commanded positions."""
    figure = blank(9.6, 3.2 * len(images))
    panels = figure.subplots(len(images), 2, squeeze=False)
    for row, image, each in zip(panels, images, positions, strict=True):
        ranges, name = (image.range_x, image.range_y), Path(image.name).name
        for axis, panel, size, count in zip(
            AXES, row, ranges, (image.pixels, image.lines), strict=True
        ):
            commanded = 0.5 * size * middles(count)
            for place, colour, width, side in (  # the thinner one shows where they coincide
                (each.trace, BLUE, 2.0, "trace"),
                (each.retrace, ORANGE, 0.8, "retrace"),
            ):
                number = AXES.index(axis)
                moved = place[..., number].mean(axis=number) - commanded
                panel.plot(MICRO * commanded, MICRO * moved, color=colour, lw=width, label=side)
            zero_line(panel)
            panel.set(
                xlabel=f"commanded {axis} in µm", ylabel=f"actual minus commanded {axis} in µm"
            )
            panel.set_title(f"{name}: {axis}, mean over the {MEANS[axis]}")
            panel.legend()
    return figure


@styled
def correction_figure(title: str, before: ScanImage, after: ScanImage) -> Figure:
    """Draw trace, retrace and their difference of an image, before and after its correction.

    The parabola in x and y that fits an image best is subtracted. Both rows have the same colours.
    Both images hold a retrace.
    """
    images = before, after
    height = len(ROWS) * PANEL * before.range_y / before.range_x + AROUND
    figure = blank(9.6, height, title)
    panels = figure.subplots(len(ROWS), len(SIDES))
    right = MICRO * max(before.range_x, after.range_x)
    top = MICRO * max(before.range_y, after.range_y)
    factor, unit = (NANO, "nm") if before.unit == "m" else (1.0, before.unit)
    rows = [_images(image, factor) for image in images]
    least, most = _percentiles(values for row in rows for values in row[:2])
    widest = _percentiles(np.abs(row[2]) for row in rows)[1]
    colours = [("afmhot", least, most)] * 2 + [("RdBu_r", -widest, widest)]
    shown = []
    for (row, column), panel in np.ndenumerate(panels):
        x, y = MICRO * images[row].range_x, MICRO * images[row].range_y
        cmap, low, high = colours[column]
        place = {"extent": (0.0, x, 0.0, y), "origin": "lower"}
        shown.append(panel.imshow(rows[row][column], cmap=cmap, vmin=low, vmax=high, **place))
        panel.set(xlim=(0.0, right), ylim=(0.0, top), xlabel="x in µm", ylabel="y in µm")
        panel.set_title(f"{SIDES[column]}, {ROWS[row]}")
        panel.label_outer()
    for drawn, of, what in (
        (shown[0], panels[:, :2], f"{before.channel} without its parabola"),
        (shown[2], panels[:, 2:], "trace minus retrace"),
    ):
        figure.colorbar(
            drawn, ax=of, label=f"{what}, {unit}", location="bottom", extend="both", aspect=30
        )
    return figure


def _images(image: ScanImage, factor: float) -> tuple[Array, Array, Array]:
    trace, retrace = (factor * levelled(np.asarray(v)) for v in (image.trace, image.retrace))
    return trace, retrace, trace - retrace


def _percentiles(values: Iterable[Array]) -> tuple[float, float]:
    low, high = np.percentile(np.concatenate([each.ravel() for each in values]), SHOWN)
    return float(low), float(high)
