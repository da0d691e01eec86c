"""How hard the default plant is: each property measured on it."""

from attrs import asdict

from afm_scan_bench.characterise import measure_plant
from afm_scan_bench.scans import default_plant
from afm_scan_ros.report.table import Table

COLUMNS = {
    "property": ("property", ""),
    "axis": ("axis", ""),
    "value": ("value", ".4g"),
    "unit": ("unit", ""),
}


def measure() -> Table:
    """Measure every property that docs/explanation/simulated_scanner.md states."""
    rows = [asdict(found) for found in measure_plant(default_plant())]
    return Table("plant", "The default plant, as measured on it", COLUMNS, rows)
