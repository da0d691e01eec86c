"""Small scans: offset, gain and shape of the true error on the default plant and on slip elements.

An atomic force microscope mostly makes scans of a few micrometres. Plays of few thresholds have no
loop below the smallest of them, so small scans are where thresholds show.
"""

from collections.abc import Callable, Iterator

from attrs import evolve

from afm_scan_bench.families.scanners import FamilyScanner
from afm_scan_bench.in_process import calibrate_in_process
from afm_scan_bench.scans import (
    ALL,
    SEED,
    default_plant,
    rms_percent,
    scan,
    spec_at,
    split_of,
    tracking,
)
from afm_scan_ros.core.identification.identify import identify_axis, identify_records
from afm_scan_ros.core.metrics import Scan
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.report.table import Row, Table

SIZES_UM = (0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 40.0)
RATES = (1.0, 5.0, 30.0)

COLUMNS = {
    "scanner": ("scanner", ""),
    "line_rate_hz": ("Hz", ".0f"),
    "size_um": ("scan, µm", "g"),
    "rms_percent": ("rms, %", ".3f"),
    "gain_percent": ("gain, %", ".3f"),
    "shape_percent": ("shape, %", ".3f"),
    "shape_nm": ("shape, nm", ".2f"),
    "offset_nm": ("offset, nm", ".2f"),
}


def measure() -> Table:
    """Scan squares of 0.5 to 40 µm with all inverses."""
    rows = [row for name, scanned in scanners().items() for row in rows_of(name, scanned)]
    title = "True error of x at constant speed by the size of the scan, the first line left out"
    return Table("small_scans", title, COLUMNS, rows)


def scanners() -> dict[str, Callable[[ScanSpec], Scan]]:
    """Identify each scanner from its own four records, and measure how it scans with its model."""
    records = calibrate_in_process(default_plant(), SEED)
    own = identify_records(list(records.values())).model
    slip = FamilyScanner.of("slip", "cube behind")
    model = identify_axis(list(slip.records().values()), "x").model
    return {
        "default plant": lambda spec: scan(spec, ALL, model=own),
        "slip elements, cube behind": lambda spec: slip.scan(spec, model),
    }


def rows_of(name: str, scanned: Callable[[ScanSpec], Scan]) -> Iterator[Row]:
    """Errors of one scanner."""
    for rate in RATES:
        for size in SIZES_UM:
            extent = 1e-6 * size
            error = tracking(scanned(evolve(spec_at(rate), range_x=extent, range_y=extent))).x
            split = split_of(error)
            yield {
                "scanner": name,
                "line_rate_hz": rate,
                "size_um": size,
                "rms_percent": rms_percent(error.constant_speed),
                "gain_percent": 100.0 * split.gain,
                "shape_percent": 100.0 * split.shape_share,
                "shape_nm": 1e9 * split.shape,
                "offset_nm": 1e9 * split.offset,
            }
