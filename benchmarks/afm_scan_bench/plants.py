"""Plant files of every effect and pair at every size.

``python -m afm_scan_bench.plants FOLDER`` writes them to FOLDER; config/plants has some of them.
"""

import sys
from collections.abc import Iterator
from os.path import relpath
from pathlib import Path

from afm_scan_bench.mechanisms.product_sizes import EFFECTS, SIZES, sized
from afm_scan_bench.mechanisms.sizes import PAIRS
from afm_scan_ros.files import share_directory, yaml
from afm_scan_ros.files.plant_file import BASE, KIND, MECHANISMS
from afm_scan_ros.files.records import to_mapping
from afm_scan_ros.simulation.mechanisms.base import Mechanism

AXIS = "x"


def plants() -> Iterator[tuple[str, str, tuple[Mechanism, ...]]]:
    """Name, heading and mechanisms of each plant."""
    for effects in (*((effect,) for effect in EFFECTS), *PAIRS):
        for size in SIZES:
            words = " and ".join(effects).replace("_", " ")
            mechanisms = (each for effect in effects for each in sized(effect, size, AXIS))
            name = f"{'_and_'.join(effects)}_{size}"
            yield name, f"The simulated scanner with {words}, {size}.", tuple(mechanisms)


def write(folder: Path) -> None:
    """Write every plant to a folder; each refers to config/plant.yaml by a relative path."""
    folder.mkdir(parents=True, exist_ok=True)
    base = relpath(share_directory() / "config/plant.yaml", folder)
    for name, heading, mechanisms in plants():
        entries = [{KIND: each.KIND, **to_mapping(each)} for each in mechanisms]
        yaml.save(folder / f"{name}.yaml", {BASE: base, MECHANISMS: entries}, heading)


if __name__ == "__main__":
    write(Path(sys.argv[1]))
