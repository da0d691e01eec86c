"""The plant files that the rule writes."""

from pathlib import Path

from attrs import evolve

from afm_scan_bench.plants import plants, write
from afm_scan_ros.files import share_directory
from afm_scan_ros.files.plant_file import load_plant
from afm_scan_ros.simulation.scanner import PlantSpec


def test_every_plant_is_read_back_as_it_was_written(tmp_path: Path, plant: PlantSpec) -> None:
    write(tmp_path)
    assert len(list(tmp_path.iterdir())) == len(list(plants()))
    for name, _, mechanisms in plants():
        found = load_plant(tmp_path / f"{name}.yaml")
        assert found == evolve(plant, mechanisms=found.mechanisms)
        assert [each.KIND for each in found.mechanisms] == [each.KIND for each in mechanisms]


def test_the_products_plant_files_are_among_them() -> None:
    names = {f"{name}.yaml" for name, _, _ in plants()}
    assert {path.name for path in (share_directory() / "config/plants").iterdir()} <= names
