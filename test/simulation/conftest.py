"""The default plant."""

import pytest

from afm_scan_ros.simulation.scanner import PlantSpec
from helpers.in_process import default_plant


@pytest.fixture(scope="session")
def plant() -> PlantSpec:
    """Return the plant of ``config/plant.yaml``."""
    return default_plant()
