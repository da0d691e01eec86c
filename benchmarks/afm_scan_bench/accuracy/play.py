"""What a play costs that is known: its inverse must cross it at each turn, and takes time to."""

from collections.abc import Iterator

from attrs import evolve

from afm_scan_bench.scans import ALL, default_model, default_plant, scan, spec_at
from afm_scan_ros.core.comparison import rms_of
from afm_scan_ros.core.metrics import Scan
from afm_scan_ros.core.model import Added, ScannerModel
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.scanner import predict
from afm_scan_ros.report.table import Row, Table
from afm_scan_ros.simulation.mechanisms.structure import LooseJoint

AXIS = "x"
WIDTHS = (80e-9, 240e-9, 800e-9)
CONTACT_TIME = 1e-6
TURNS = ((5.0, 0.1), (30.0, 0.1), (30.0, 0.3), (100.0, 0.2))
"""Line rate, Hz, and the share of a line in which it turns round."""

COLUMNS = {
    "line_rate_hz": ("line rate, Hz", ".0f"),
    "turnaround": ("turn", ".1f"),
    "width_nm": ("play, nm", ".0f"),
    "healthy_nm": ("error without, nm", ".1f"),
    "error_nm": ("with, nm", ".1f"),
    "ratio": ("ratio", ".2f"),
    "crossing_nm": ("model's own error, nm", ".1f"),
}


def measure() -> Table:
    """Scan 40 µm with known plays and their inverse, on the scanner and on the model itself."""
    rows = [row for turn in TURNS for row in rows_of(*turn)]
    title = "True tracking error of x with a play that the model knows exactly"
    return Table("play", title, COLUMNS, rows)


def rows_of(line_rate: float, turnaround: float) -> Iterator[Row]:
    """Errors at one line rate, the plays from narrow to wide."""
    spec = evolve(spec_at(line_rate), turnaround=turnaround)
    healthy = _error(scan(spec, ALL))
    for width in WIDTHS:
        done, known = _scanned(spec, width)
        yield {
            "line_rate_hz": line_rate,
            "turnaround": turnaround,
            "width_nm": 1e9 * width,
            "healthy_nm": 1e9 * healthy,
            "error_nm": 1e9 * _error(done),
            "ratio": _error(done) / healthy,
            "crossing_nm": 1e9 * _error(evolve(done, true=predict(known, done.drive))),
        }


def _scanned(spec: ScanSpec, width: float) -> tuple[Scan, ScannerModel]:
    """Scan of the plant with a play, and the model that knows it."""
    model, joint = (
        default_model(),
        LooseJoint(axis=AXIS, gap=0.5 * width, contact_time=CONTACT_TIME),
    )
    known = evolve(model, x=evolve(model.axis("x"), added=(Added("backlash", "", (width,)),)))
    return scan(spec, ALL, None, evolve(default_plant(), mechanisms=(joint,)), known), known


def _error(done: Scan) -> float:
    return rms_of(done.tracking("true"), AXIS)
