"""Line-to-line feedback on scanners that drift: the drift neither restarts nor is in the model."""

from collections.abc import Iterator

import numpy as np
from attrs import evolve

from afm_scan_bench.learning.fed_back_scan import fed_back_scan
from afm_scan_bench.scans import default_plant, spec_at
from afm_scan_ros.core.metrics import Scan
from afm_scan_ros.core.trajectory import phases, sample_kinds
from afm_scan_ros.core.types import Array
from afm_scan_ros.files import share_directory
from afm_scan_ros.files.plant_file import load_plant
from afm_scan_ros.report.table import Row, Table
from afm_scan_ros.simulation.scanner import PlantSpec

LINES = {5.0: (16, 10), 30.0: (60, 10), 100.0: (120, 20)}
"""Lines of a scan, and how many are left out of the figures, by line rate (Hz)."""
LONGER = 4
"""Times as many lines where nothing drifts, so that the range of the scanner suffices."""
AGE = 3.0
"""Seconds since the scanner was switched on: some drifts reverse in the scan."""
NOISIER = 5.0

COLUMNS = {
    "scanner": ("scanner", ""),
    "line_rate_hz": ("Hz", ".0f"),
    "lines": ("lines", ".0f"),
    "from_line": ("from line", ".0f"),
    "x_without_nm": ("x without, nm rms", ".1f"),
    "x_rms_nm": ("with", ".1f"),
    "x_largest_nm": ("largest line", ".1f"),
    "y_without_nm": ("y without, nm rms", ".1f"),
    "y_rms_nm": ("with", ".1f"),
    "y_largest_nm": ("largest line", ".1f"),
}


def measure() -> Table:
    """Scan scanners that are still, and that drift, without and with line feedback."""
    rows = [row for name, plant in scanners().items() for row in rows_of(name, plant)]
    title = "True error at constant speed, of squares of 40 µm, without and with line feedback"
    return Table("line_feedback", title, COLUMNS, rows)


def scanners() -> dict[str, PlantSpec]:
    """Return scanners that are still and that drift, of some age."""
    still = default_plant()
    noisy = evolve(still.sensor, noise_rms=NOISIER * still.sensor.noise_rms)
    names = ("settling_drift", "reversing_drift", "warming_piezo")
    folder = share_directory() / "config/changing"
    drifting = {name.replace("_", " "): load_plant(folder / f"{name}.yaml") for name in names}
    return {"still": still, "still, 5 times the noise": evolve(still, sensor=noisy), **drifting}


def rows_of(name: str, plant: PlantSpec) -> Iterator[Row]:
    """Figures of one scanner by line rate."""
    for rate, (fewest, left_out) in LINES.items():
        lines = fewest * (LONGER if name.startswith("still") else 1)
        spec = evolve(spec_at(rate), lines=lines)
        without, fed_back = (
            line_errors(fed_back_scan(spec, plant, age=AGE, corrects=corrects))[:, left_out:]
            for corrects in (False, True)
        )
        yield {
            "scanner": name,
            "line_rate_hz": rate,
            "lines": lines,
            "from_line": left_out + 1,
            **_figures("x", without[0], fed_back[0]),
            **_figures("y", without[1], fed_back[1]),
        }


def line_errors(done: Scan) -> Array:
    """Rms (m) of the true error of each line at constant speed, (2, lines): of y on the trace."""
    spec, where = done.spec, phases(done.spec).lines
    kinds = sample_kinds(spec, where.start, spec.samples_per_line)
    parts = (kinds.trace | kinds.retrace, kinds.trace)
    found = []
    for axis, part in zip(("x", "y"), parts, strict=True):
        error = (done.true.axis(axis) - done.desired.axis(axis))[where.start : where.stop]
        found.append(np.sqrt(np.mean(error.reshape(spec.lines, -1)[:, part] ** 2, axis=1)))
    return np.array(found)


def _figures(axis: str, without: Array, fed_back: Array) -> Row:
    return {
        f"{axis}_without_nm": 1e9 * _rms(without),
        f"{axis}_rms_nm": 1e9 * _rms(fed_back),
        f"{axis}_largest_nm": 1e9 * float(fed_back.max()),
    }


def _rms(of_lines: Array) -> float:
    return float(np.sqrt(np.mean(of_lines**2)))
