"""The plant file: what the simulated scanner is made of."""

from pathlib import Path

from afm_scan_ros.files import yaml
from afm_scan_ros.files.records import from_mapping
from afm_scan_ros.simulation.spec import PlantSpec


def load_plant(path: Path) -> PlantSpec:
    """Read a plant file such as ``config/plant.yaml``.

    Raises InputError naming the file, the key and the mend.
    """
    return from_mapping(PlantSpec, yaml.load(path), str(path))
