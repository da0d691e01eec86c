"""The plant files of config/plants hold the product's mechanisms at their sizes."""

from pathlib import Path

import pytest
from attrs import evolve

from afm_scan_bench.mechanisms.product_sizes import sized
from afm_scan_ros.files import share_directory
from afm_scan_ros.files.plant_file import load_plant
from afm_scan_ros.files.records import to_mapping

DEFAULT = share_directory() / "config/plant.yaml"


@pytest.mark.parametrize(
    "path", sorted((DEFAULT.parent / "plants").iterdir()), ids=lambda p: p.stem
)
def test_a_plant_file_holds_what_its_name_says(path: Path) -> None:
    effects, size = path.stem.rsplit("_", 1)
    mechanisms = [each for name in effects.split("_and_") for each in sized(name, size, "x")]
    plant = load_plant(path)
    assert [to_mapping(each) for each in plant.mechanisms] == [to_mapping(m) for m in mechanisms]
    assert evolve(plant, mechanisms=()) == load_plant(DEFAULT)
