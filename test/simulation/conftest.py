"""The default plant, which the simulation's tests measure."""

from pathlib import Path

import pytest

from afm_scan_ros.files.plant_file import load_plant
from afm_scan_ros.simulation.spec import PlantSpec


@pytest.fixture(scope="session")
def plant() -> PlantSpec:
    """Return the plant of ``config/plant.yaml``."""
    return load_plant(Path(__file__).parents[2] / "config/plant.yaml")
