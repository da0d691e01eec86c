"""Images of a chrome grating with a particle of dust, and what is measured in them."""

import numpy as np
from attrs import evolve, field, frozen
from attrs.validators import gt

from afm_scan_bench.paper.grating import GratingFigures, grating_figures
from afm_scan_bench.paper.regrid import regrid
from afm_scan_bench.paper.ripple import Ripple, line_path
from afm_scan_bench.paper.scanner import PaperScan
from afm_scan_ros.core.image_lines import Imaged, LineImager, frame_of
from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.sample import Grating

RESONANCE = 454.0
"""The scanner's first natural frequency, Hz."""

GRATING = Grating(angle=np.radians(25.0), offset=8e-6)
"""Pitch 16 µm, as the paper's; it gives neither the grating's angle nor its place."""

DUST_BAR = 1
"""The bar with the dust, counted from that through ``GRATING.offset``."""

PIXELS = 220
REACH = 2e-6
"""Distance between measured lines, m, beyond which nothing is drawn between them."""


@frozen
class Dust:
    """A particle, round as a paraboloid, on whatever lies below it (all in m)."""

    x: float
    y: float
    radius: float = field(validator=gt(0.0))
    peak: float = field(validator=gt(0.0))
    below: Imaged

    def height(self, x: Array, y: Array) -> Array:
        """Height of what lies below, and the particle's on top."""
        distance = ((x - self.x) ** 2 + (y - self.y) ** 2) / self.radius**2
        return self.below.height(x, y) + self.peak * np.maximum(0.0, 1.0 - distance)


def specimen(size: float) -> Dust:
    """Return the grating with a particle on a bar, near the middle of an image of a size (m)."""
    along = 0.5 * size
    across = GRATING.offset + DUST_BAR * GRATING.pitch
    x = (across - along * np.sin(GRATING.angle)) / np.cos(GRATING.angle)
    return Dust(float(x), along, radius=2.2e-6, peak=60e-9, below=GRATING)


@frozen(eq=False)
class Picture:
    """One scan's images on the expected path, and the figures of the trace's.

    Heights in m: rows are lines, columns run along x; both are positions in m. The ripples are
    None where a line is too short or its pixels too few.
    """

    columns: Array
    rows: Array
    trace: Array
    retrace: Array
    figures: GratingFigures
    strongest: Ripple | None
    at_resonance: Ripple | None


def picture(scan: PaperScan) -> Picture:
    """Image the specimen along a scan and measure the image."""
    spec = scan.spec
    centred = evolve(spec, centre_x=0.5 * spec.range_x)
    frame = frame_of(centred, min(PIXELS, spec.samples_per_line // 2 - 1))
    rows = np.linspace(0.0, spec.range_y, spec.lines)
    lines = list(LineImager(spec, frame).add(scan.desired.x, heights_along(scan)))
    trace = np.stack([line.trace for line in lines])
    path = line_path(trace, GRATING.pitch / np.cos(GRATING.angle), 0.5 / spec.line_rate)
    return Picture(
        columns=frame.centres,
        rows=rows,
        trace=trace,
        retrace=np.stack([line.retrace for line in lines]),
        figures=grating_figures(trace, frame.centres, rows),
        strongest=path.strongest() if path.shows_ripple else None,
        at_resonance=path.at(RESONANCE) if path.shows_ripple else None,
    )


def heights_along(scan: PaperScan) -> Array:
    """Return the specimen's height wherever the scan really was."""
    return specimen(scan.spec.range_x).height(scan.true.x, scan.true.y)


def regridded(scan: PaperScan, like: Picture) -> Array:
    """Image the traces on the measured path, on the pixels of another image of the same scan."""
    signals = (scan.measured.x, scan.measured.y, heights_along(scan))
    x, y, heights = (signal.reshape(scan.spec.lines, 2, -1)[:, 0] for signal in signals)
    return regrid(x, y, heights, like.columns, like.rows, REACH)
