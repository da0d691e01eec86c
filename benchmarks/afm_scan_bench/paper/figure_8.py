"""Fig. 8: the drive predicted by the inverse hysteresis, and the drive applied."""

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure

from afm_scan_bench.accuracy.fresh_drives import loops
from afm_scan_bench.accuracy.hysteresis import predictions, record
from afm_scan_bench.paper.section import Compared, Drawn, Section
from afm_scan_bench.scans import SEED, default_model
from afm_scan_ros.core.identification.records.recording import misfit
from afm_scan_ros.core.record import Record
from afm_scan_ros.core.types import Array
from afm_scan_ros.report.paper import STYLE, styled
from afm_scan_ros.report.picture import BLUE, GREY, ORANGE

MILLI = 1e3
EXACT, DIRECT = "exact", "direct (the paper's)"
POINTS = 20_000
CAPTION = "Applied and predicted drive, their difference, and the hysteresis that was inverted"

TEXT = (
    "Slow moves between random levels within ±3.8 V, which were not fitted; the measured"
    " displacement, freed of creep and vibration, goes through the inverse hysteresis, which"
    " predicts the drive. The direct inverse is the paper's (Eq. 17, 51 by 51 values, from"
    " displacement to drive); the exact one walks the memory of the forward model backwards. Both"
    " come closer than the paper's: the records carry 2 nm of sensor noise, the vibration's lag"
    " and the converter's hold are taken off before the surface is fitted, and the simulated"
    " hysteresis, though of another operator than the model, does not depend on rate."
)


def section() -> Section:
    """Predict a fresh record's drive with both inverses."""
    fresh = record(loops(np.random.default_rng(SEED)))["x"]
    predicted = predictions(default_model().axis("x"), fresh)
    errors = {name: misfit(drive - fresh.drive[:, 0]) for name, drive in predicted.items()}
    compared = [
        row
        for name in (DIRECT, EXACT)
        for row in (
            Compared(f"sigma (Eq. 18), {name}", 0.0416, errors[name].sigma, "V", ".4f"),
            Compared(f"largest error (Eq. 19), {name}", 0.118, errors[name].maximum, "V", ".4f"),
        )
    ]
    return Section(
        name="figure_8",
        title="Fig. 8: the inverse hysteresis, verified",
        text=TEXT,
        compared=compared,
        pictures=[Drawn("drive", _drawn(fresh, predicted), CAPTION)],
        numbers={
            name.split()[0]: {"sigma_v": error.sigma, "max_v": error.maximum}
            for name, error in errors.items()
        },
    )


@styled
def _drawn(fresh: Record, predicted: Mapping[str, Array]) -> Figure:
    """Draw the drives over time, the errors below, and the hysteresis that was undone beside."""
    figure = Figure(figsize=(9.6, 4.6), layout="constrained")
    grid = figure.add_gridspec(2, 2, width_ratios=(1.7, 1.0), height_ratios=(1.6, 1.0))
    drive, displacement = fresh.signals("x")
    every = slice(None, None, max(1, len(drive) // POINTS))
    time = (np.arange(len(drive)) * fresh.sample_period)[every]
    above = figure.add_subplot(grid[0, 0])
    above.plot(time, drive[every], color=GREY, lw=3.0, label="applied")
    above.plot(time, predicted[DIRECT][every], color=BLUE, label="predicted")
    above.set_ylabel("drive in V")
    above.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2, borderaxespad=0.2)
    below = figure.add_subplot(grid[1, 0], sharex=above)
    for name, colour in ((DIRECT, ORANGE), (EXACT, BLUE)):
        error = MILLI * (predicted[name] - drive)
        below.plot(time, error[every], color=colour, lw=0.7, label=name)
    below.axhline(0.0, color=STYLE["axes.edgecolor"], lw=0.6)
    below.set(xlabel="time in s", ylabel="error in mV")
    below.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2, borderaxespad=0.2)
    beside = figure.add_subplot(grid[:, 1])
    beside.plot(drive[every], 1e6 * displacement[every], color=BLUE, lw=0.6)
    beside.set(xlabel="drive in V", ylabel="measured x in µm")
    return figure
