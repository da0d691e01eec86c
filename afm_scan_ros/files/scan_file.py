"""The scan specification: a ROS parameter file of the trajectory generator."""

from collections.abc import Collection, Mapping
from fnmatch import fnmatch
from pathlib import Path
from typing import Any

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.scan_spec import ScanSpec, human_name, scan_parameters
from afm_scan_ros.files import yaml
from afm_scan_ros.files.records import from_mapping, refuse_unknown, to_mapping

NODE = "trajectory_generator"
PARAMETERS = "ros__parameters"


def load_scan(path: Path, others: Collection[str] = ()) -> tuple[ScanSpec, dict[str, Any]]:
    """Read the scan of a file, and those of the node's ``others`` parameters that it sets.

    The file is in ROS's form: ``/**/trajectory_generator:`` or ``/**:``, then
    ``ros__parameters:``; sections for other nodes are left to them. Raises InputError naming
    the file, the key and the fix.
    """
    given = node_parameters(yaml.load(path), str(path))
    names = [human_name(parameter) for parameter in scan_parameters()]
    refuse_unknown(given, [*names, *others], str(path))
    spec = {name: value for name, value in given.items() if name in names}
    rest = {name: value for name, value in given.items() if name not in names}
    return from_mapping(ScanSpec, spec, str(path)), rest


def save_scan(path: Path, spec: ScanSpec, heading: str) -> None:
    """Write a scan file, and its folder where there is none."""
    path.parent.mkdir(parents=True, exist_ok=True)
    yaml.save(path, {f"/**/{NODE}": {PARAMETERS: to_mapping(spec)}}, heading)


def node_parameters(content: Mapping[str, Any], where: str, node: str = NODE) -> dict[str, Any]:
    """Parameters that a file in ROS's form gives a node, later ones winning."""
    sections = {name: body for name, body in content.items() if _is_for_node(name, node)}
    if not sections:
        raise InputError(f"{where}: no section for the node; begin it with '/**/{node}:'")
    given: dict[str, Any] = {}
    for name, body in sections.items():
        if not isinstance(body, Mapping) or not isinstance(body.get(PARAMETERS), Mapping):
            raise InputError(f"{where}: '{name}:' must hold '{PARAMETERS}:' with the parameters")
        refuse_unknown(body, [PARAMETERS], f"{where}: {name}")
        given.update(body[PARAMETERS])
    return given


def _is_for_node(section: str, node: str) -> bool:
    return fnmatch(f"/{node}", f"/{section.removeprefix('/**/').removeprefix('/')}")
