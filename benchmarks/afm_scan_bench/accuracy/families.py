"""True tracking error of scanners of five families of hysteresis, by the default settings."""

from collections.abc import Iterator

from attrs import evolve

from afm_scan_bench.families.scanners import FAMILIES, MAPS, FamilyScanner
from afm_scan_bench.scans import rms_percent, spec_at, tracking
from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.identification.identify import FittedAxis, identify_axis
from afm_scan_ros.report.table import Row, Table

SHARES, RATES = (0.2, 0.4, 0.9), (1.0, 5.0, 30.0)
TARGET, TARGET_LOCAL, TARGET_LOCAL_SMALL = 0.1, 0.3, 0.6
LOCAL = ("bouc_wen", "duhem")
"""Families whose memory is their present output alone."""

COLUMNS = {
    "family": ("family", ""),
    "maps": ("maps", ""),
    "operator": ("operator", ""),
    "mapped": ("map", ""),
    "stated_percent": ("stated for a whole scan, %", ".4f"),
    "direct_mv": ("direct inverse, mV", ".1f"),
    "share_percent": ("% of range", ".0f"),
    "rms_percent": ("rms, %: 1 Hz", ".3f"),
    "rms_percent_5": ("5 Hz", ".3f"),
    "rms_percent_30": ("30 Hz", ".3f"),
    "target_percent": ("target", ".1f"),
    "refused": ("", ""),
}


def measure() -> Table:
    """Identify each family between each pair of maps from a full calibration, and scan with it."""
    rows = [row for family in FAMILIES for maps in MAPS for row in rows_of(family, maps)]
    title = "Five families of hysteresis: rms true error of x at constant speed, % of the scan"
    return Table("families", title, COLUMNS, rows)


def rows_of(family: str, maps: str) -> Iterator[Row]:
    """Errors of one scanner at three sizes and three line rates."""
    scanner = FamilyScanner.of(family, maps)
    row: Row = {"family": family, "maps": maps}
    try:
        found = identify_axis(list(scanner.records().values()), "x")
    except (InputError, ScanError) as error:
        yield {**row, "refused": str(error)}
        return
    for share in SHARES:
        yield {**row, **chosen(found), **errors(scanner, found, share), **target(family, share)}


def chosen(found: FittedAxis) -> Row:
    """Operator, error stated of a scan over the whole drive, and error of the direct inverse."""
    return {
        "operator": found.operator,
        "mapped": "yes" if found.model.hysteresis.output else "no",
        "stated_percent": 100.0 * found.deviation,
        "direct_mv": 1e3 * found.direct.sigma,
    }


def errors(scanner: FamilyScanner, found: FittedAxis, share: float) -> Row:
    """Rms errors of scans over a share of the range, % of the scan."""
    extent = share * scanner.reach()
    row: dict[str, float | str] = {"share_percent": 100.0 * share}
    for rate in RATES:
        spec = evolve(spec_at(rate), range_x=extent, range_y=extent)
        name = "rms_percent" if rate == RATES[0] else f"rms_percent_{rate:g}"
        try:
            done = scanner.scan(spec, found.model)
            row[name] = rms_percent(tracking(done).x.constant_speed)
        except (InputError, ScanError) as error:
            row["refused"] = str(error)
    return row


def target(family: str, share: float) -> Row:
    """Error asked for, % of the scan."""
    local = TARGET_LOCAL_SMALL if share == SHARES[0] else TARGET_LOCAL
    return {"target_percent": local if family in LOCAL else TARGET}
