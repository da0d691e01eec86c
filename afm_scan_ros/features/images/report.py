"""What images of a grating show of a scanner: a table of figures, and pictures."""

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np

from afm_scan_ros.core.model import Status
from afm_scan_ros.core.types import AXES, Array
from afm_scan_ros.features.images.grating.features import levelled
from afm_scan_ros.features.images.grating.models import APART, Positions
from afm_scan_ros.features.images.grating.motion import middles
from afm_scan_ros.features.images.grating.rough_motion import FINEST
from afm_scan_ros.features.images.identify import ImageIdentification
from afm_scan_ros.features.images.scan_image import ScanImage, both_sides
from afm_scan_ros.report.page import CommandLine, ReportPage, Section
from afm_scan_ros.report.paper import paper_figure
from afm_scan_ros.report.picture import (
    BLUE,
    MICRO,
    NANO,
    ORANGE,
    Curve,
    Map,
    Panel,
    Picture,
    image_row,
    picked_lines,
)
from afm_scan_ros.report.scan_pictures import WAYS
from afm_scan_ros.report.table import Table

COLUMNS = {
    "image": ("image", ""),
    "axis": ("axis", ""),
    "figure": ("figure", ""),
    "value": ("value", ".4f"),
    "lower": ("95 % from", ".4f"),
    "upper": ("to", ".4f"),
    "unit": ("unit", ""),
}
KEPT = "axis", "value", "lower", "upper", "unit"
"""Columns that are attributes of a figure."""
FASTER = 10.0
"""Line rate to record next over that of the images."""
TOGETHER = "upwards and downwards"
SHOWN = 1.0, 99.0
"""Percentiles of the values at which the colours end, so that a spike does not hide the rest."""
ROWS = "as recorded", "corrected"
SIDES = *WAYS, "trace minus retrace"
X = "x in µm"


def grating_table(found: ImageIdentification) -> Table:
    """Return the figures of each image, and of both directions; its picture shows deviations.

    Lengths in % are of the commanded range. The title names each image that was refused, and why.
    """
    names = [Path(image.name).name for image in found.images]
    pairs = [*zip(names, found.figures, strict=True), (TOGETHER, found.drift)]
    rows = [
        {"image": name, "figure": each.name, **{key: getattr(each, key) for key in KEPT}}
        for name, every in pairs
        for each in every
    ]
    title = "What the images show of the scanner"
    if found.refused:
        title += f" (not used: {'; '.join(found.refused)})"
    deviation = deviation_picture(found.images, found.positions)
    return Table("grating", title, COLUMNS, rows, lambda: paper_figure(deviation))


def left_out(found: ImageIdentification) -> Iterator[str]:
    """Yield which lines of each image are not known, beside the one scanned first."""
    for image, positions in zip(found.images, found.positions, strict=True):
        count = image.lines - len(positions.trace[positions.known])
        if count > 1:
            yield (
                f"{Path(image.name).name}: no edge shows y in the {count} lines scanned first, just"
                " after y turned. Corrected images leave them out."
            )


def not_separated(found: ImageIdentification) -> Iterator[str]:
    """Yield what the images cannot separate, and the image to record next."""
    images, x = found.images, found.model.effects["x"]
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


def deviation_picture(images: Sequence[ScanImage], positions: Sequence[Positions]) -> Picture:
    """Show how far x and y of each image are from the commanded positions."""
    rows = [
        [_deviation(image, each, axis) for axis in AXES]
        for image, each in zip(images, positions, strict=True)
    ]
    caption = (
        "How far x and y are from the commanded positions: the mean of x over the lines, that of y"
        " over the pixels of a line."
    )
    return Picture("deviation", caption, rows)


def _deviation(image: ScanImage, found: Positions, axis: str) -> Panel:
    number = AXES.index(axis)
    size, count = ((image.range_x, image.pixels), (image.range_y, image.lines))[number]
    commanded = 0.5 * size * middles(count)
    curves = []
    for way, colour, width in zip(WAYS, (BLUE, ORANGE), (2.0, 0.8), strict=True):  # both are seen
        deviation = getattr(found, way)[..., number].mean(axis=number) - commanded
        curves.append(Curve(MICRO * commanded, MICRO * deviation, way, colour, width))
    title = f"{Path(image.name).name}: {axis}"
    x, y = f"commanded {axis} in µm", f"deviation of {axis} in µm"
    return Panel(curves, x, y, title, level=0.0)


def correction_picture(before: ScanImage, after: ScanImage) -> Picture:
    """Show trace, retrace and their difference of an image, before and after its correction.

    The parabola in x and y that fits an image best is subtracted. Both rows have the same colours.
    Both images hold a retrace.
    """
    unit, recorded = _heights(before)
    corrected = _heights(after)[1]
    every = recorded, corrected
    ends = _percentiles(values for row in every for values in row[:2])
    widest = _percentiles(np.abs(row[2]) for row in every)[1]
    span = 0.0, MICRO * before.range_x, 0.0, MICRO * before.range_y
    images, lines = [], []
    for row, state in zip(every, ROWS, strict=True):
        maps = [Map(values, span, unit, *ends) for values in row[:2]]
        difference = Map(row[2], span, unit, -widest, widest, signed=True)
        titles = [f"{side}, {state}" for side in SIDES]
        images.append(image_row([*maps, difference], titles, X, "y in µm"))
        picked, label = picked_lines(maps, WAYS), f"{before.channel} in {unit}"
        lines.append(Panel(picked, X, label, f"a line, {state}"))
    name = Path(before.name)
    caption = (
        f"{name.name} as it was recorded and as the model corrects it, without its parabola. Tap an"
        " image to see the line there."
    )
    return Picture(name.stem, caption, [*images, lines], title=name.name)


def grating_report(
    found: ImageIdentification,
    table: Table,
    known: Sequence[str],
    advice: Sequence[str | CommandLine],
) -> ReportPage:
    """Return the report on a scanner identified from images.

    ``known`` says what the model holds, ``advice`` what the images cannot tell, which can, and what
    to do next.
    """
    pairs = [(a, b) for a, b in zip(found.images, found.corrected, strict=True) if b is not None]
    deviation = deviation_picture(found.images, found.positions)
    pictures = [*(correction_picture(a, b) for a, b in pairs), deviation]
    return ReportPage(
        title="A scanner identified from images of a grating",
        answer=[
            *(_answer(*pair) for pair in pairs[:1]),
            "The model corrects other images of this scanner too.",
        ],
        picture=pictures[0],
        next_steps=advice,
        evidence=[
            Section("What the model holds", known),
            Section("Figures of each image, with 95 % intervals", [table.text()]),
            Section("Other images, and the deviation of the positions", pictures[1:]),
        ],
    )


def _answer(before: ScanImage, after: ScanImage) -> str:
    """Say how far trace and retrace of an image differ, before and after correction."""
    (unit, recorded), (_, corrected) = _heights(before), _heights(after)
    first, then = (f"{np.sqrt(np.mean(row[2] ** 2)):.3g}" for row in (recorded, corrected))
    return (
        f"Trace and retrace of {Path(before.name).name} differ by {first} {unit} rms as recorded,"
        f" and by {then} {unit} after correction."
    )


def _heights(image: ScanImage) -> tuple[str, tuple[Array, Array, Array]]:
    """Return the unit of trace, retrace and their difference, and these without their parabola."""
    factor, unit = (NANO, "nm") if image.unit == "m" else (1.0, image.unit)
    trace, retrace = (factor * levelled(values) for values in both_sides(image))
    return unit, (trace, retrace, trace - retrace)


def _percentiles(values: Iterable[Array]) -> tuple[float, float]:
    low, high = np.percentile(np.concatenate([each.ravel() for each in values]), SHOWN)
    return float(low), float(high)
