"""Fig. 12: the scan path at 30 Hz: drift by creep, offset by hysteresis, oscillations."""

import numpy as np
from matplotlib.figure import Figure

from afm_scan_bench.paper.images import ALL
from afm_scan_bench.paper.picture import RESONANCE
from afm_scan_bench.paper.ripple import LinePath
from afm_scan_bench.paper.scanner import PaperScan, paper_spec, scan_as_paper
from afm_scan_bench.paper.section import Compared, Drawn, Section
from afm_scan_ros.core.types import Array
from afm_scan_ros.report.paper import STYLE, styled
from afm_scan_ros.report.picture import BLUE, GREY, ORANGE

LINE_RATE = 30.0
LINES = 128
SHOWN = 3
MICRO, MILLI, NANO = 1e6, 1e3, 1e9

TEXT = (
    "x over the first three lines and over the last three of 128, four seconds later: desired,"
    " without compensation, with all inverses. As in the paper, without compensation the second"
    " line does not start at x = 0, the path oscillates at the first resonance, and creep makes it"
    " drift; with compensation all three are gone. The paper gives the path as a drawing, without"
    " numbers. The remaining error with compensation is at the corners of the triangle, which the"
    " optimal inverse smooths."
)


def section() -> Section:
    """Scan without and with all inverses."""
    spec = paper_spec(LINE_RATE, LINES)
    none, every = scan_as_paper(spec, ()), scan_as_paper(spec, ALL)
    figures = {"none": _figures(none), "all": _figures(every)}
    names = {
        "second_start_m": "start of the second line",
        "ripple_m": "oscillation at 454 Hz",
        "drift_m": "drift from the second to the last line",
    }
    published = {"none": "seen", "all": "removed"}
    return Section(
        name="figure_12",
        title="Fig. 12: the scan path at 30 Hz",
        text=TEXT,
        compared=[
            Compared(f"{name}, {case}", published[case], NANO * figures[case][key], "nm", ",.0f")
            for key, name in names.items()
            for case in figures
        ],
        pictures=[
            Drawn("path", _drawn(none, every), "The first three lines, and the last three of 128")
        ],
        numbers=figures,
    )


def _figures(scan: PaperScan) -> dict[str, float]:
    """Measure the path: where the second line starts, how it oscillates, how far it drifts."""
    size = scan.spec.samples_per_line
    error = (scan.true.x - scan.desired.x).reshape(scan.spec.lines, size)
    middle = error[scan.spec.lines // 2, : size // 2]
    time = scan.spec.sample_period * np.arange(size // 2, dtype=np.float64)
    return {
        "second_start_m": float(scan.true.x[size]),
        "ripple_m": LinePath(time, middle).at(RESONANCE).amplitude,
        "drift_m": float(error[-1].mean() - error[1].mean()),
    }


@styled
def _drawn(none: PaperScan, every: PaperScan) -> Figure:
    figure = Figure(figsize=(9.6, 5.2), layout="constrained")
    panels = figure.subplots(2, 2, sharex="col", sharey="row", height_ratios=(1.6, 1.0))
    size = none.spec.samples_per_line
    runs = (slice(0, SHOWN * size), slice(-SHOWN * size, None))
    time = MILLI * none.spec.sample_period * np.arange(none.desired.x.size)
    for (above, below), run in zip(panels.T, runs, strict=True):
        above.plot(time[run], MICRO * none.desired.x[run], color=GREY, lw=3.0, label="desired")
        for scan, colour, name in ((none, ORANGE, "without compensation"), (every, BLUE, "with")):
            above.plot(time[run], MICRO * scan.true.x[run], color=colour, label=name)
            below.plot(time[run], MICRO * _error(scan)[run], color=colour)
        for panel in (above, below):
            panel.axhline(0.0, color=STYLE["axes.edgecolor"], lw=0.6, zorder=0)
        below.set_xlabel("time in ms")
    panels[0, 0].set_ylabel("x in µm")
    panels[1, 0].set_ylabel("error in µm")
    panels[0, 0].legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=3, borderaxespad=0.2)
    return figure


def _error(scan: PaperScan) -> Array:
    return scan.true.x - scan.desired.x
