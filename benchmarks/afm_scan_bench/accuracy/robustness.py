"""What it costs when the scanner, or how it is scanned, is not what was identified.

One thing differs at a time: the resonance, its damping, how fast it creeps, the range and the line
rate. The identification knew ±4 V at slow ramps, multisines of 1.5 V and steps of 0.5 V.
"""

from collections.abc import Callable, Iterator

from attrs import evolve

from afm_scan_bench.curve import TableCurve
from afm_scan_bench.detune import detuned, with_creep_rate
from afm_scan_bench.scans import (
    ALL,
    BENCH_SPEC,
    default_plant,
    largest_percent,
    rms_percent,
    scan,
    spec_at,
    tracking,
)
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.report.table import Row, Table
from afm_scan_ros.simulation.scanner import PlantSpec

LINE_RATES = (1.0, 30.0, 100.0, 250.0)
RESONANCE_PERCENT = (-5, -3, -1, 0, 1, 3, 5)
DAMPING_PERCENT = (-50, -20, -10, 0, 10, 20, 50)
CREEP_RATE_PERCENT = (-50, -20, -10, 0, 10, 20, 50)
RANGES_UM = (10, 20, 30, 40, 50)
OTHER_RATES = {
    0.2: (20_000, 0.1),
    2.0: (10_000, 0.1),
    10.0: (2_000, 0.1),
    50.0: (800, 0.1),
    75.0: (600, 0.2),
    150.0: (300, 0.2),
    200.0: (250, 0.3),
    225.0: (200, 0.3),
}
"""Line rates (Hz) that no other figure is stated at: samples a line, and turn-around."""

COLUMNS = {
    "study": ("what differs", ""),
    "value": ("by", "g"),
    "scan": ("scan", ""),
    "x_rms_percent": ("x rms at constant speed, %", ".3f"),
    "x_max_percent": ("x max, %", ".2f"),
}


def measure() -> Table:
    """Scan with all inverses of the default model, one thing at a time being otherwise."""
    rows = [*_rows_of_plants(), *_rows_of_ranges(), *_rows_of_rates()]
    title = "All inverses where the scanner or the scan is not as identified"
    curve = TableCurve("value", "x_rms_percent", by="scan", logarithmic=True, panel="study")
    return Table("robustness", title, COLUMNS, rows, curve.picture(title, COLUMNS, rows))


def errors(spec: ScanSpec, plant: PlantSpec | None = None) -> Row:
    """Rms and largest error of one scan with all inverses, % of its range."""
    found = tracking(scan(spec, ALL, plant=plant)).x.constant_speed
    return {"x_rms_percent": rms_percent(found), "x_max_percent": largest_percent(found)}


def _rows_of_plants() -> Iterator[Row]:
    plant = default_plant()
    studies: dict[str, tuple[tuple[int, ...], Callable[[float], PlantSpec]]] = {
        "plant's resonance off, %": (RESONANCE_PERCENT, lambda f: detuned(plant, f, 1.0)),
        "plant's damping off, %": (DAMPING_PERCENT, lambda f: detuned(plant, 1.0, f)),
        "plant's creep rate off, %": (CREEP_RATE_PERCENT, lambda f: with_creep_rate(plant, f)),
    }
    for study, (shifts, changed) in studies.items():
        for rate in LINE_RATES:
            for shift in shifts:
                found = errors(spec_at(rate), changed(1.0 + shift / 100.0))
                yield {"study": study, "value": shift, "scan": f"{rate:g} Hz", **found}


def _rows_of_ranges() -> Iterator[Row]:
    for rate in LINE_RATES:
        for range_um in RANGES_UM:
            spec = evolve(spec_at(rate), range_x=1e-6 * range_um)
            yield {
                "study": "range, µm (% are of it)",
                "value": range_um,
                "scan": f"{rate:g} Hz",
                **errors(spec),
            }


def _rows_of_rates() -> Iterator[Row]:
    for rate, (samples, turnaround) in OTHER_RATES.items():
        spec = evolve(
            BENCH_SPEC,
            line_rate=rate,
            samples_per_line=samples,
            turnaround=turnaround,
            y_step=min(BENCH_SPEC.y_step, 0.4 / rate),
        )
        yield {"study": "line rate, Hz", "value": rate, "scan": "40 µm", **errors(spec)}
