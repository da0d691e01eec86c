"""Pictures of a residual: before and after what it was traced to, against its floor."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from afm_scan_ros.core.tracing.axis_trace import AxisTrace
from afm_scan_ros.core.tracing.diagnosis import Diagnosis
from afm_scan_ros.report.style import BLUE, GREY, ORANGE, styled

NANO = 1e9


@styled
def spectrum_figure(found: Diagnosis) -> Figure:
    """Draw each axis' residual by band in the record where it is loudest, with its floor."""
    figure = Figure(figsize=(9.6, 3.2), layout="constrained")
    for panel, trace in zip(figure.subplots(1, 2), found.traces.values(), strict=True):
        _spectrum(panel, trace, loudest(trace))
    return figure


def loudest(trace: AxisTrace) -> int:
    """Number of the record whose residual exceeds its floor most."""
    return int(np.argmax([float(ratio.max()) for ratio in trace.ratio_before]))


def _spectrum(panel: Axes, trace: AxisTrace, record: int) -> None:
    evidence = trace.evidence[record]
    floor = evidence.floor
    edges = np.maximum(floor.edges, floor.edges[1] / 10.0)
    drawn = {
        "floor": (floor.rms, GREY),
        "before": (trace.ratio_before[record] * floor.rms, ORANGE),
        "after": (trace.ratio_after[record] * floor.rms, BLUE),
    }
    for label, (rms, colour) in drawn.items():
        panel.stairs(NANO * rms, edges, color=colour, label=label, lw=1.4)
    panel.set(xlabel="frequency in Hz", ylabel="residual rms in nm", xscale="log", yscale="log")
    panel.set_title(f"{trace.axis}: {evidence.playback.view.name}")
    panel.legend()
