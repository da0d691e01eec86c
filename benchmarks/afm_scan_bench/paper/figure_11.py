"""Fig. 11: images of the grating at 250 Hz, over half the first resonance."""

import numpy as np

from afm_scan_bench.paper.images import (
    ALL,
    HOW,
    MICRO,
    drawings,
    figure_numbers,
    figure_rows,
    image,
)
from afm_scan_bench.paper.scanner import PaperScan
from afm_scan_bench.paper.section import Compared, Section

LINE_RATE = 250.0
CASES = {"(a) none": (), "(b) all": ALL}

BARE = "(a) none"

TEXT = (
    "As in the paper: without compensation the image is hardly one of a grating; with it the bars"
    " are straight but near the ends of the lines, where the optimal inverse smooths the"
    " triangle's corners, and so the range in x shrinks. Ours shrinks little: its weight (5 kHz,"
    " order 2) lets more of the triangle through than the paper's, which is not published. Fewer"
    " pixels fit into a line of 2 ms, and a period of 454 Hz cannot be separated from its bend, so"
    " no ripple is given. "
)


def section(lines: int) -> Section:
    """Scan and image both cases."""
    done = {name: image(LINE_RATE, inverses, lines) for name, inverses in CASES.items()}
    pictures = {name: each.picture for name, each in done.items()}
    bare, every = done[BARE], done["(b) all"]
    shrunk = 100.0 * (1.0 - range_x(every.scan) / every.scan.spec.range_x)
    return Section(
        name="figure_11",
        title="Fig. 11: the grating at 250 Hz",
        text=TEXT + HOW,
        compared=[
            Compared(
                "bars in view, (b)", "not stated", every.picture.figures.bars_in_view, form="d"
            ),
            Compared("pitch, (b)", 16.0, MICRO * (every.picture.figures.pitch or 0.0), "µm", ".2f"),
            Compared("range in x lost to smoothing, (b)", "visible", shrunk, "%", ".1f"),
        ],
        pictures=drawings(pictures, BARE, bare),
        details=figure_rows(pictures),
        numbers=figure_numbers(pictures),
    )


def range_x(scan: PaperScan) -> float:
    """Peak to peak, m, of the last line's true x."""
    return float(np.ptp(scan.true.x[-scan.spec.samples_per_line :]))
