"""The files of a scan: its specification, parameters of its source, the plant and the sample."""

import warnings
from collections.abc import Collection, Mapping
from fnmatch import fnmatch
from pathlib import Path
from typing import Any

import numpy as np
from attrs import evolve

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.scan_spec import ScanSpec, human_name, scan_parameters
from afm_scan_ros.core.types import Array
from afm_scan_ros.files import yaml
from afm_scan_ros.files.arrays import read_npy
from afm_scan_ros.files.records import from_mapping, naming, refuse_unknown, to_mapping
from afm_scan_ros.simulation.mechanisms import mechanism_type
from afm_scan_ros.simulation.mechanisms.base import Mechanism
from afm_scan_ros.simulation.sample import HeightMap
from afm_scan_ros.simulation.scanner import PlantSpec

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
    yaml.save(path, {f"/**/{NODE}": {PARAMETERS: to_mapping(spec)}}, heading)


def node_parameters(content: Mapping[str, Any], where: str, node: str = NODE) -> dict[str, Any]:
    """Parameters that a file in ROS's form gives a node, later ones winning."""
    names = {name: f"/{name.removeprefix('/**/').removeprefix('/')}" for name in content}
    sections = {name: content[name] for name in names if fnmatch(f"/{node}", names[name])}
    if not sections:
        raise InputError(f"{where}: no section for the node; begin it with '/**/{node}:'")
    given: dict[str, Any] = {}
    for name, body in sections.items():
        if not isinstance(body, Mapping) or not isinstance(body.get(PARAMETERS), Mapping):
            raise InputError(f"{where}: '{name}:' must hold '{PARAMETERS}:' with the parameters")
        refuse_unknown(body, [PARAMETERS], f"{where}: {name}")
        given.update(body[PARAMETERS])
    return given


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


PICTURES = ("PNG", "JPEG", "TIFF", "BMP", "GIF", "WEBP", "PPM")
"""Formats of pictures; others may run a program, as that of PostScript does."""
LARGEST = 2**26  # bytes of a file
MOST_PIXELS = 2**24
"""Pixels of a picture, more than the samples of any line see of it."""
LUMINANCE = (0.2126, 0.7152, 0.0722)  # of red, green and blue, ITU-R BT.709


def load_sample(path: Path, width: float, white: float) -> HeightMap:
    """Read a height map whose first and last columns are ``width`` (m) apart.

    An ``.npy`` file holds heights in m, row 0 at the lowest y. Of a picture, top row first too,
    black is height 0 and white is ``white`` (m). Raises InputError naming the file.
    """
    if not path.is_file():
        raise InputError(f"{path}: no such file; give a .npy array or a picture")
    if path.stat().st_size > LARGEST:
        raise InputError(f"{path}: over {LARGEST >> 20} MB; give a smaller map")
    heights = _array(path) if path.suffix == ".npy" else white * _brightness(path)
    with naming(path):
        return HeightMap(heights, width)


def _array(path: Path) -> Array:
    values = read_npy(path)
    if values.dtype.kind not in "fiu":
        raise InputError(f"{path}: an array of {values.dtype}, not of numbers")
    return np.asarray(values, dtype=np.float64)


def _brightness(path: Path) -> Array:
    """Return 0 for black to 1 for white, shape (rows, columns)."""
    from matplotlib.image import imread  # noqa: PLC0415 - slow to import, needed only here

    try:
        _refuse_large(path)
        picture = imread(path)
    except Exception as error:  # Pillow raises whatever a damaged picture makes it run into
        raise InputError(f"{path}: not a picture that can be read: {error}") from error
    scale = np.iinfo(picture.dtype).max if picture.dtype.kind == "u" else 1.0
    if picture.ndim == 2:  # noqa: PLR2004 - grey
        return np.asarray(picture, dtype=np.float64) / scale
    weights = LUMINANCE if picture.shape[2] >= len(LUMINANCE) else (1.0,)  # grey and alpha
    values = np.zeros(picture.shape[:2])
    for colour, weight in enumerate(weights):
        values += (weight / scale) * picture[..., colour]
    return values


def _refuse_large(path: Path) -> None:
    """Raise ValueError for a picture that states more pixels than a sample needs."""
    from PIL import Image  # noqa: PLC0415 - as matplotlib's reader

    with warnings.catch_warnings(action="ignore"), Image.open(path, formats=PICTURES) as picture:
        columns, rows = picture.size
    if columns * rows > MOST_PIXELS:
        raise ValueError(f"{columns} by {rows} pixels, over {MOST_PIXELS} in all: scale it down")
