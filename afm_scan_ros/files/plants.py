"""The plants with an undeclared effect: ``python -m afm_scan_ros.files.plants`` writes them."""

from collections.abc import Iterator

from afm_scan_ros.files.plant_file import save_mechanisms
from afm_scan_ros.files.share import share_directory
from afm_scan_ros.simulation.mechanisms.base import Mechanism
from afm_scan_ros.simulation.mechanisms.sizes import EFFECTS, PAIRS, SIZES, sized

AXIS = "x"
BASE = "../plant.yaml"


def plants() -> Iterator[tuple[str, str, tuple[Mechanism, ...]]]:
    """Name, heading and mechanisms of each plant."""
    for effects in (*((effect,) for effect in EFFECTS), *PAIRS):
        for size in SIZES:
            words = " and ".join(effects).replace("_", " ")
            mechanisms = (each for effect in effects for each in sized(effect, size, AXIS))
            name = f"{'_and_'.join(effects)}_{size}"
            yield name, f"The simulated scanner with {words}, {size}.", tuple(mechanisms)


def main() -> None:
    """Write every plant to config/plants."""
    folder = share_directory() / "config/plants"
    folder.mkdir(exist_ok=True)
    for name, heading, mechanisms in plants():
        save_mechanisms(folder / f"{name}.yaml", BASE, mechanisms, heading)


if __name__ == "__main__":
    main()
