"""How often an effect is named in scans as long as an image."""

from afm_scan_bench.diagnosis.diagnosis_plants import SHARING, table
from afm_scan_bench.diagnosis.unmodelled.cases import image_cases
from afm_scan_bench.diagnosis.unmodelled.runs import outcomes
from afm_scan_bench.diagnosis.unmodelled.sets import IMAGE_PLANTS
from afm_scan_ros.report.table import Table


def measure() -> Table:
    """Diagnose every effect at its medium size, on held-out plants."""
    return table("diagnosis_images", outcomes(image_cases(IMAGE_PLANTS, SHARING)))
