"""Picture of held-out measured reversal curves, predicted, and of the residual."""

from collections.abc import Sequence

from matplotlib.figure import Figure

from afm_scan_bench.measured.reversal_curve import ReversalCurve
from afm_scan_ros.report.paper import styled
from afm_scan_ros.report.picture import BLUE, GREY, ORANGE

KILO, MILLI, MICRO = 1e3, 1e-3, 1e-6


@styled
def forc_figure(held_out: Sequence[ReversalCurve], found: Sequence[ReversalCurve]) -> Figure:
    """Held-out curves, measured and predicted; error over the field."""
    figure = Figure(figsize=(9.6, 3.4), dpi=120, layout="constrained")
    figure.suptitle(
        "First-order reversal curves (hchb_forc), data © 2024 Peyton Murray, MIT licence",
        x=0.01,
        ha="left",
    )
    loops, errors = figure.subplots(1, 2)
    for measured, predicted in list(zip(held_out, found, strict=True))[1::3]:
        field = measured.inputs / KILO
        loops.plot(field, measured.outputs / MILLI, color=GREY, lw=3.0)
        loops.plot(field, predicted.outputs / MILLI, color=BLUE, lw=0.8)
    for measured, predicted in zip(held_out, found, strict=True):
        error = (predicted.outputs - measured.outputs) / MICRO
        errors.plot(measured.inputs / KILO, error, ".", ms=1.5, color=ORANGE)
    loops.set(title="Left out (grey), predicted (blue)", xlabel="field in kOe")
    loops.set_ylabel("moment in memu")
    errors.set(title="Predicted less measured", xlabel="field in kOe", ylabel="moment in µemu")
    return figure
