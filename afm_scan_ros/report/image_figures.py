"""Pictures of a closed loop: the errors and an image, before and after."""

import numpy as np
from attrs import frozen
from matplotlib.figure import Figure

from afm_scan_ros.core.imaging.lines import LineImager, frame_of
from afm_scan_ros.core.scan import Scan
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.trajectory import phases
from afm_scan_ros.core.types import AXES, Array, Trace
from afm_scan_ros.report.style import BLUE, GREY, ORANGE, styled
from afm_scan_ros.simulation.sample import Grating

MICRO, NANO, MILLI = 1e6, 1e9, 1e3
GRATING = Grating(pitch=16e-6, angle=float(np.radians(25.0)))
PIXELS = 256
SHOWN = 3
"""Lines in the picture of the errors, after the first."""


@styled
def error_figure(before: Scan, after: Scan) -> Figure:
    """Draw the true error of both axes over a few lines, before and after."""
    spec = before.spec
    start = phases(spec).lines.start + spec.samples_per_line
    shown = slice(start, start + SHOWN * spec.samples_per_line)
    time = MILLI * spec.sample_period * np.arange(len(before.true.x[shown]))
    figure = Figure(figsize=(9.6, 4.4), layout="constrained")
    for panel, axis in zip(figure.subplots(2, 1, sharex=True), AXES, strict=True):
        for scan, colour, name in ((before, ORANGE, "before"), (after, BLUE, "after")):
            error = scan.true.axis(axis) - scan.desired.axis(axis)
            panel.plot(time, NANO * error[shown], color=colour, lw=0.8, label=name)
        panel.axhline(0.0, color=GREY, lw=0.6, zorder=0)
        panel.set_ylabel(f"{axis} error in nm")
    figure.axes[0].legend(loc="lower right", ncols=2, bbox_to_anchor=(1.0, 1.0))
    figure.axes[-1].set_xlabel("time in ms")
    return figure


@frozen(eq=False)
class Images:
    """Heights (m) along the lines' traces, (lines, pixels): as it is, before and after."""

    spec: ScanSpec
    ideal: Array
    before: Array
    after: Array

    def wrong(self, image: Array) -> float:
        """Rms height (m) by which an image differs from what is really there."""
        return float(np.sqrt(np.mean((image - self.ideal) ** 2)))


def images_of(before: Scan, after: Scan) -> Images:
    """Image a grating by two scans of the same lines, drawn on the expected path."""
    spec, desired = before.spec, before.desired
    paths = (desired, before.true, after.true)
    return Images(spec, *(_image(spec, desired, path) for path in paths))


@styled
def image_figure(images: Images) -> Figure:
    """Draw the grating as it is imaged before and after, and what is wrong with either image."""
    figure = Figure(figsize=(9.6, 7.2), layout="constrained")
    half_x, half_y = (0.5 * MICRO * size for size in (images.spec.range_x, images.spec.range_y))
    extent = (-half_x, half_x, -half_y, half_y)
    panels = figure.subplots(2, 2, sharex=True, sharey=True)
    pairs = (("before", images.before), ("after", images.after))
    wrong = [NANO * (image - images.ideal) for _, image in pairs]
    largest = float(np.abs(wrong).max())
    for column, (name, image) in enumerate(pairs):
        height, error = panels[:, column]
        height.imshow(NANO * image, cmap="gray", origin="lower", extent=extent, aspect="auto")
        height.set_title(name)
        shown = error.imshow(
            wrong[column],
            cmap="RdBu_r",
            origin="lower",
            extent=extent,
            aspect="auto",
            vmin=-largest,
            vmax=largest,
        )
        error.set_title(f"{name}, less what is there")
        error.set_xlabel("x in µm")
    for panel in panels[:, 0]:
        panel.set_ylabel("y in µm")
    figure.colorbar(shown, ax=panels[1], label="wrong by, in nm", fraction=0.04)
    return figure


def _image(spec: ScanSpec, desired: Trace, path: Trace) -> Array:
    where = phases(spec).lines
    lines = slice(where.start, where.stop)
    heights = GRATING.height(path.x[lines], path.y[lines])
    frame = frame_of(spec, min(PIXELS, spec.samples_per_line // 2 - 1))
    made = LineImager(spec, frame).add(desired.x[lines], heights)
    return np.stack([line.trace for line in made])
