"""The plant file: what the simulated scanner is made of."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from attrs import evolve

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.files import yaml
from afm_scan_ros.files.records import from_mapping, refuse_unknown
from afm_scan_ros.simulation.mechanisms import mechanism_type
from afm_scan_ros.simulation.mechanisms.base import Mechanism
from afm_scan_ros.simulation.scanner import PlantSpec

BASE, MECHANISMS, KIND = "base", "mechanisms", "kind"


def load_plant(path: Path, above: tuple[Path, ...] = ()) -> PlantSpec:
    """Read a plant file such as ``config/plant.yaml``.

    A file may hold ``mechanisms:``, a list whose entries begin with their ``kind:``. Instead of
    the scanner it may hold ``base:``, the path of another plant file, relative to its folder.
    ``above`` are the files that led to this one.
    Raises InputError naming the file, the key and the fix.
    """
    content = yaml.load(path)
    given = content.pop(MECHANISMS, [])
    if not isinstance(given, list):
        raise InputError(f"{path}: {MECHANISMS} should be a list, as '- {{kind: ...}}'")
    found = [_mechanism(each, f"{path}: {MECHANISMS}[{i}]") for i, each in enumerate(given)]
    plant = _scanner(content, path, (*above, path.resolve()))
    return evolve(plant, mechanisms=(*plant.mechanisms, *found))


def _scanner(content: dict[str, Any], path: Path, above: tuple[Path, ...]) -> PlantSpec:
    if BASE not in content:
        return from_mapping(PlantSpec, content, str(path))
    refuse_unknown(content, [BASE, MECHANISMS], str(path))
    base = content[BASE]
    if not isinstance(base, str):
        raise InputError(f"{path}: {BASE} = {base!r} should be the path of a plant file")
    if (path.parent / base).resolve() in above:
        raise InputError(
            f"{path}: {BASE} = {base!r} refers back to the file itself: name another plant file"
        )
    return load_plant(path.parent / base, above)


def _mechanism(given: object, where: str) -> Mechanism:
    if not isinstance(given, Mapping) or KIND not in given:
        raise InputError(
            f"{where}: key '{KIND}' is missing; begin the mechanism with it, as '{{kind: ...}}'"
        )
    found = mechanism_type(str(given[KIND]))
    if found is None:
        known = ", ".join(sorted(Mechanism.KINDS))
        raise InputError(f"{where}: unknown {KIND} {given[KIND]!r}: give one of {known}")
    if isinstance(given.get("axis"), bool):
        raise InputError(f"{where}: axis: y is YAML for 'true'; put it in quotes, as 'y'")
    rest = {key: value for key, value in given.items() if key != KIND}
    return from_mapping(found, rest, where)
