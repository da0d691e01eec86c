"""How often an effect is named in scans as long as an image."""

from afm_scan_bench.diagnosis.diagnosis import SHARING, table
from afm_scan_bench.diagnosis.unmodelled.cases import IMAGES, image_cases
from afm_scan_bench.diagnosis.unmodelled.runs import outcomes
from afm_scan_ros.report.table import Table


def measure() -> Table:
    """Trace every effect at its middling size, on plants that were kept aside."""
    return table("diagnosis_images", outcomes(image_cases(IMAGES, SHARING)))
