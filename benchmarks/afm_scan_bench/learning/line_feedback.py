"""Line-to-line feedback on scanners that drift: the drift neither restarts nor is in the model."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from attrs import evolve

from afm_scan_bench.learning.fed_back_scan import fed_back_scan
from afm_scan_bench.scans import ALL, default_plant, scan, spec_at
from afm_scan_ros.core.scan import Scan
from afm_scan_ros.core.trajectory import phases, sample_kinds
from afm_scan_ros.files.plant_file import load_plant
from afm_scan_ros.files.share import share_directory
from afm_scan_ros.report.table import Row, Table
from afm_scan_ros.simulation.spec import PlantSpec

CHANGING = share_directory() / "config/changing"
LINES = {5.0: 40, 30.0: 60, 100.0: 120}
"""Lines of the scans, by line rate (Hz)."""
SETTLED = 10
"""Lines that are left out of the figures."""
RANGE = {"settling drift": 25e-6}
"""Of scans (m) that drift further than the scanner can follow at 40 µm."""

COLUMNS = {
    "scanner": ("scanner", ""),
    "line_rate_hz": ("Hz", ".0f"),
    "size_um": ("scan, µm", ".0f"),
    "feedback": ("feedback", ""),
    "x_rms_nm": ("x, nm rms", ".1f"),
    "x_largest_nm": ("x, largest line", ".1f"),
    "y_rms_nm": ("y, nm rms", ".1f"),
    "y_largest_nm": ("y, largest line", ".1f"),
}


def measure() -> Table:
    """Scan scanners that are still, and that drift, without and with line feedback."""
    rows = [row for name, plant in scanners().items() for row in rows_of(name, plant)]
    title = f"True error at constant speed from line {SETTLED + 1} on"
    return Table("line_feedback", title, COLUMNS, rows)


def scanners() -> dict[str, PlantSpec]:
    """Return the default scanner, and those that drift."""
    names = ("settling_drift", "reversing_drift", "warming_piezo")
    drifting = {name.replace("_", " "): _plant(CHANGING / f"{name}.yaml") for name in names}
    return {"still": default_plant(), **drifting}


def rows_of(name: str, plant: PlantSpec) -> Iterator[Row]:
    """Figures of one scanner by line rate."""
    for rate, lines in LINES.items():
        size = RANGE.get(name, 40e-6)
        spec = evolve(spec_at(rate), lines=lines, range_x=size, range_y=size)
        made = {"none": scan(spec, ALL, plant=plant), "line": fed_back_scan(spec, plant)}
        for feedback, done in made.items():
            (x, y) = line_errors(done)[:, SETTLED:]
            yield {
                "scanner": name,
                "line_rate_hz": rate,
                "size_um": 1e6 * size,
                "feedback": feedback,
                "x_rms_nm": 1e9 * np.sqrt(np.mean(x**2)),
                "x_largest_nm": 1e9 * x.max(),
                "y_rms_nm": 1e9 * np.sqrt(np.mean(y**2)),
                "y_largest_nm": 1e9 * y.max(),
            }


def line_errors(done: Scan) -> np.ndarray:
    """Rms (m) of the true error of each line at constant speed, (2, lines): of y on the trace."""
    spec, where = done.spec, phases(done.spec).lines
    kinds = sample_kinds(spec, where.start, spec.samples_per_line)
    parts = (kinds.trace | kinds.retrace, kinds.trace)
    found = []
    for axis, part in zip(("x", "y"), parts, strict=True):
        error = (done.true.axis(axis) - done.desired.axis(axis))[where.start : where.stop]
        on_lines = error.reshape(spec.lines, -1)[:, part]
        found.append(np.sqrt(np.mean(on_lines**2, axis=1)))
    return np.array(found)


def _plant(path: Path) -> PlantSpec:
    return load_plant(path)
