"""What images of a grating show of a scanner: a table of figures, and pictures."""

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np

from afm_scan_ros.core.model import BaseEffects, Status
from afm_scan_ros.core.types import AXES, Array
from afm_scan_ros.features.images.grating.features import levelled
from afm_scan_ros.features.images.grating.models import APART, Positions
from afm_scan_ros.features.images.grating.motion import middles
from afm_scan_ros.features.images.grating.registered_image import ImageQuantity
from afm_scan_ros.features.images.grating.rough_motion import FINEST
from afm_scan_ros.features.images.scan_image import ScanImage
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
    PickedLine,
    Picture,
)
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
X = "x in µm"


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
    return Table(
        "grating", title, COLUMNS, rows, lambda: paper_figure(deviation_picture(images, positions))
    )


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


def deviation_picture(images: Sequence[ScanImage], positions: Sequence[Positions]) -> Picture:
    """Show how far x and y of each image are from the commanded positions."""
    rows = []
    for image, each in zip(images, positions, strict=True):
        ranges, name = (image.range_x, image.range_y), Path(image.name).name
        row = []
        for axis, size, count in zip(AXES, ranges, (image.pixels, image.lines), strict=True):
            number, commanded = AXES.index(axis), 0.5 * size * middles(count)
            curves = [
                Curve(MICRO * commanded, MICRO * (place - commanded), side, colour, width)
                for place, colour, width, side in (  # the thinner one shows where they coincide
                    (each.trace[..., number].mean(axis=number), BLUE, 2.0, "trace"),
                    (each.retrace[..., number].mean(axis=number), ORANGE, 0.8, "retrace"),
                )
            ]
            label = f"deviation of {axis} in µm"
            title = f"{name}: {axis}, mean over the {MEANS[axis]}"
            row.append(Panel(curves, f"commanded {axis} in µm", label, title, level=0.0))
        rows.append(row)
    return Picture("deviation", "How far x and y are from the commanded positions.", rows)


def correction_picture(before: ScanImage, after: ScanImage) -> Picture:
    """Show trace, retrace and their difference of an image, before and after its correction.

    The parabola in x and y that fits an image best is subtracted. Both rows have the same colours.
    Both images hold a retrace.
    """
    factor, unit = (NANO, "nm") if before.unit == "m" else (1.0, before.unit)
    rows = [_images(image, factor) for image in (before, after)]
    heights = _percentiles(values for row in rows for values in row[:2])
    widest = _percentiles(np.abs(row[2]) for row in rows)[1]
    name = Path(before.name).name
    maps = [
        [
            *(_map(image, values, unit, *heights) for values in row[:2]),
            _map(image, row[2], unit, -widest, widest, signed=True),
        ]
        for image, row in zip((before, after), rows, strict=True)
    ]
    panels = [
        [Panel([of], X, "y in µm", f"{side}, {state}") for of, side in zip(row, SIDES, strict=True)]
        for row, state in zip(maps, ROWS, strict=True)
    ]
    lines = [
        Panel(
            [
                PickedLine(of, side, colour)
                for of, side, colour in zip(row, SIDES[:2], (BLUE, ORANGE), strict=False)
            ],
            X,
            f"{before.channel} in {unit}",
            f"a line, {state}",
        )
        for row, state in zip(maps, ROWS, strict=True)
    ]
    caption = (
        f"{name} as it was recorded and as the model corrects it, without its parabola. Tap an"
        " image to see the line there."
    )
    return Picture(Path(before.name).stem, caption, [*panels, lines], title=name)


def _map(
    image: ScanImage, values: Array, unit: str, low: float, high: float, *, signed: bool = False
) -> Map:
    right, top = MICRO * image.range_x, MICRO * image.range_y
    return Map(values, 0.0, right, 0.0, top, unit, low, high, signed)


def grating_report(
    table: Table,
    images: Sequence[ScanImage],
    corrected: Sequence[ScanImage | None],
    deviation: Picture,
    known: Sequence[str],
    advice: Sequence[str],
) -> ReportPage:
    """Return the report on a scanner identified from ``images``.

    ``known`` says what the model holds, ``advice`` what the images cannot tell, and which can.
    """
    pairs = [(a, b) for a, b in zip(images, corrected, strict=True) if b is not None]
    pictures = [*(correction_picture(a, b) for a, b in pairs), deviation]
    return ReportPage(
        title="A scanner identified from images of a grating",
        answer=[*_answers(pairs), "The model corrects other images of this scanner too."],
        picture=pictures[0],
        next_steps=[
            *advice,
            CommandLine(
                "Correct another image of this scanner.",
                "afm-scan grating IMAGE --pitch PITCH --out MODEL --correct OTHER --images FOLDER",
            ),
        ],
        evidence=[
            Section("What the model holds", known),
            Section("Figures of each image, with 95 % intervals", [table.text()]),
            Section("Other images, and the deviation of the positions", pictures[1:]),
        ],
    )


def _answers(pairs: Sequence[tuple[ScanImage, ScanImage]]) -> Iterator[str]:
    """Say how far trace and retrace of the first image differ, before and after correction."""
    for before, after in pairs[:1]:
        factor, unit = (NANO, "nm") if before.unit == "m" else (1.0, before.unit)
        differences = [
            f"{np.sqrt(np.mean(_images(image, factor)[2] ** 2)):.3g}" for image in (before, after)
        ]
        yield (
            f"Trace and retrace of {Path(before.name).name} differ by {differences[0]} {unit} rms"
            f" as recorded, and by {differences[1]} {unit} after correction."
        )


def _images(image: ScanImage, factor: float) -> tuple[Array, Array, Array]:
    trace, retrace = (factor * levelled(np.asarray(v)) for v in (image.trace, image.retrace))
    return trace, retrace, trace - retrace


def _percentiles(values: Iterable[Array]) -> tuple[float, float]:
    low, high = np.percentile(np.concatenate([each.ravel() for each in values]), SHOWN)
    return float(low), float(high)
