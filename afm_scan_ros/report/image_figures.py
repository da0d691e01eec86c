"""Pictures of two scans of the same lines: their errors, and a grating imaged by each."""

from typing import Any

import numpy as np
from attrs import frozen
from matplotlib.figure import Figure

from afm_scan_ros.core.imaging.lines import LineImager, frame_of
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.trajectory import phases
from afm_scan_ros.core.types import AXES, Array, Trace
from afm_scan_ros.report.style import BLUE, MICRO, MILLI, NANO, ORANGE, blank, styled, zero_line
from afm_scan_ros.simulation.sample import Grating

GRATING = Grating(pitch=16e-6, angle=float(np.radians(25.0)))
PIXELS = 256
SHOWN = 3
"""Lines in the picture of the errors, after the first."""


@frozen(eq=False)
class TwoScans:
    """Two scans of the same lines: the desired displacement and the achieved ones, m.

    ``names`` state how each was made, as "with compensation".
    """

    spec: ScanSpec
    desired: Trace
    achieved: tuple[Trace, Trace]
    names: tuple[str, str]


@frozen(eq=False)
class Images:
    """Heights (m) along the lines' traces, (lines, pixels): without error, and by each scan."""

    spec: ScanSpec
    ideal: Array
    imaged: tuple[Array, Array]
    names: tuple[str, str]

    @property
    def errors(self) -> tuple[float, float]:
        """Rms height error (m) of each image."""
        first, second = (float(np.sqrt(np.mean((i - self.ideal) ** 2))) for i in self.imaged)
        return first, second


def images_of(scans: TwoScans) -> Images:
    """Image a grating by two scans; heights are drawn at the desired positions.

    Raises InputError where the pattern has no lines.
    """
    first, second = (_image(scans.spec, scans.desired, path) for path in scans.achieved)
    ideal = _image(scans.spec, scans.desired, scans.desired)
    return Images(scans.spec, ideal, (first, second), scans.names)


@styled
def error_figure(scans: TwoScans) -> Figure:
    """Draw the error of both axes over a few lines, of both scans."""
    spec = scans.spec
    start = phases(spec).lines.start + spec.samples_per_line
    shown = slice(start, start + SHOWN * spec.samples_per_line)
    time = MILLI * spec.sample_period * np.arange(len(scans.desired.x[shown]))
    figure = blank(9.6, 4.4)
    for panel, axis in zip(figure.subplots(2, 1, sharex=True), AXES, strict=True):
        lines = zip(scans.achieved, (ORANGE, BLUE), (1.6, 0.7), scans.names, strict=True)
        for path, colour, width, name in lines:  # the thinner one shows where they coincide
            error = path.axis(axis) - scans.desired.axis(axis)
            panel.plot(time, NANO * error[shown], color=colour, lw=width, label=name)
        zero_line(panel)
        panel.set_ylabel(f"{axis} error in nm")
    figure.axes[0].legend(loc="lower right", ncols=2, bbox_to_anchor=(1.0, 1.0))
    figure.axes[-1].set_xlabel("time in ms")
    return figure


@styled
def image_figure(images: Images) -> Figure:
    """Draw the grating as each scan images it, and the height error of either image."""
    figure = blank(9.6, 7.2)
    half_x, half_y = (0.5 * MICRO * size for size in (images.spec.range_x, images.spec.range_y))
    area: dict[str, Any] = {
        "origin": "lower",
        "extent": (-half_x, half_x, -half_y, half_y),
        "aspect": "auto",
    }
    panels = figure.subplots(2, 2, sharex=True, sharey=True)
    wrong = [NANO * (image - images.ideal) for image in images.imaged]
    largest = float(np.abs(wrong).max())
    for column, name in enumerate(images.names):
        height, error = panels[:, column]
        drawn = height.imshow(NANO * images.imaged[column], cmap="gray", **area)
        height.set_title(f"image {name}")
        shown = error.imshow(wrong[column], cmap="RdBu_r", vmin=-largest, vmax=largest, **area)
        error.set(title=f"height error {name}", xlabel="x in µm")
    for panel in panels[:, 0]:
        panel.set_ylabel("y in µm")
    figure.colorbar(drawn, ax=panels[0], label="height in nm", fraction=0.04)
    figure.colorbar(shown, ax=panels[1], label="height error in nm", fraction=0.04)
    return figure


def _image(spec: ScanSpec, desired: Trace, path: Trace) -> Array:
    where = phases(spec).lines
    lines = slice(where.start, where.stop)
    heights = GRATING.height(path.x[lines], path.y[lines])
    frame = frame_of(spec, min(PIXELS, spec.samples_per_line // 2 - 1))
    made = LineImager(spec, frame).add(desired.x[lines], heights)
    return np.stack([line.trace for line in made])
