"""Why a quasi-static record is not static: the loop's width against the ramp's rate.

Creep widens slow loops, the converter's hold and the scanner's delay fast ones; what is left when
the record is freed of both is the hysteresis, whose width no rate changes.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from afm_scan_bench.accuracy.hysteresis import effective_input, record
from afm_scan_bench.characterise import effective_input as true_effective_input
from afm_scan_bench.scans import default_model, default_plant
from afm_scan_ros.core.identification.alternating import REFERENCE_GAIN
from afm_scan_ros.core.identification.drives.waveforms import Waypoints, whole
from afm_scan_ros.core.types import AXES, Array
from afm_scan_ros.report.style import BLUE, GREY, LIGHT_BLUE, ORANGE, styled
from afm_scan_ros.report.table import Row, Table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LIMIT = 3.9  # V, within the identified ±4 V
CORNERS = LIMIT * np.array([0.0, 1.0, -1.0, 1.0, -1.0, 0.0])  # the last loop is looked at
RATES = (0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0, 300.0, 1000.0)  # V/s
SAMPLES_PER_VOLT = 2000
SAMPLE_RATES = (2e3, 100e3)  # Hz, least and greatest
BLEND = 0.05
"""Share of a ramp over which its speed rises and falls."""
LEVELS = np.linspace(-0.9, 0.9, 181) * LIMIT
COLOURS = {
    "as_recorded": LIGHT_BLUE,
    "without_creep": BLUE,
    "without_all": ORANGE,
    "static": GREY,
}

COLUMNS = {
    "axis": ("axis", ""),
    "rate": ("ramp, V/s", "g"),
    "as_recorded": ("as recorded, %", ".2f"),
    "without_creep": ("freed of creep, %", ".2f"),
    "without_all": ("also of vibration and hold, %", ".2f"),
    "static": ("the plant's own, %", ".2f"),
}


def measure() -> Table:
    """Widths of the loop over ±3.9 V at nine rates, both axes driven alike."""
    rows = [row for rate in RATES for row in rows_at(rate)]
    title = "Width of the loop over ±3.9 V against the rate of its ramps"
    return Table("ramp_rate", title, COLUMNS, rows, picture=lambda: draw(rows))


def rows_at(rate: float) -> list[Row]:
    """Widths at one rate (V/s), as shares of the loop's height, %, of each axis."""
    plan = ramps(rate)
    drive = whole(plan)
    found: list[Row] = []
    for axis, fresh in record(drive, 1.0 / plan.sample_period).items():
        model = default_model().axis(axis)
        outputs = {
            "as_recorded": fresh.displacement / REFERENCE_GAIN,
            "without_creep": fresh.freed_of(model.creep).displacement / REFERENCE_GAIN,
            "without_all": effective_input(model, fresh),
            "static": true_effective_input(default_plant().axes()[axis], drive),
        }
        widths = {name: 100.0 * loop_width(plan, output) for name, output in outputs.items()}
        found.append({"axis": axis, "rate": rate, **widths})
    return found


def ramps(rate: float) -> Waypoints:
    """Ramps along the corners at a rate (V/s)."""
    sample_rate = float(np.clip(SAMPLES_PER_VOLT * rate, *SAMPLE_RATES))
    moves = np.rint(np.abs(np.diff(CORNERS)) / rate * sample_rate)
    samples = np.concatenate([[0.0], np.cumsum(moves)])
    return Waypoints(1.0 / sample_rate, CORNERS, samples, BLEND * moves[1])


def loop_width(plan: Waypoints, output: Array) -> float:
    """Largest difference between the last loop's branches at equal drive, over its height."""
    bottom, top, end = plan.samples[2:5].astype(np.int64)
    drive = whole(plan)
    rising = np.interp(LEVELS, drive[bottom:top], output[bottom:top])
    falling = np.interp(LEVELS, drive[end:top:-1], output[end:top:-1])
    return float(np.max(falling - rising) / np.ptp(output[bottom:end]))


@styled
def draw(rows: Sequence[Row]) -> "Figure":
    """Draw the widths over the rate, a panel for each axis."""
    from matplotlib.figure import Figure  # noqa: PLC0415 - slow to import, needed only here

    figure = Figure(figsize=(6.4, 3.2), layout="constrained")
    for k, axis in enumerate(AXES, start=1):
        axes = figure.add_subplot(1, 2, k, title=axis, xscale="log", xlabel=COLUMNS["rate"][0])
        ours = [row for row in rows if row["axis"] == axis]
        for name, colour in COLOURS.items():
            widths = [row[name] for row in ours]
            axes.plot([row["rate"] for row in ours], widths, "o-", ms=3, c=colour, label=name)
        axes.set_ylabel("width of the loop, % of its height")
    axes.legend([COLUMNS[name][0] for name in COLOURS])
    return figure
