"""How often an effect is named in scans as long as an image."""

from afm_scan_ros.bench.diagnosis import SHARING, table
from afm_scan_ros.bench.table import Table
from afm_scan_ros.bench.undeclared.cases import IMAGES, image_cases
from afm_scan_ros.bench.undeclared.runs import outcomes


def measure() -> Table:
    """Trace every effect at its middling size, on plants that were kept aside."""
    return table("diagnosis_images", outcomes(image_cases(IMAGES, SHARING)))
