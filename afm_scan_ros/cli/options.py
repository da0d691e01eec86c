"""What the options of several commands have in common: paths, and numbers with a unit."""

import math
import re
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

import click

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.files.share import share_directory
from afm_scan_ros.files.units import A_NUMBER, METRES, SECONDS, VOLTS, in_ascii

CONFIG = share_directory() / "config"

FILE = click.Path(dir_okay=False, path_type=Path)
FOLDER = click.Path(file_okay=False, path_type=Path)
RECORD = click.Path(path_type=Path)
"""A rosbag2 folder, an .mcap file, or a table of numbers."""


def refuse_existing(*paths: Path, other: str = "folder") -> None:
    """Raise InputError for the first of these paths that is there already."""
    for path in paths:
        if path.exists():
            raise InputError(f"{path} exists already: give another {other} or remove it")


def warn(texts: Iterable[str]) -> None:
    """Write each text as a warning on stderr."""
    for text in texts:
        click.echo(f"warning: {text}", err=True)


FACTORS: Mapping[str, Mapping[str, float]] = {
    "m": METRES,
    "V": VOLTS,
    "Hz": {"": 1.0, "Hz": 1.0, "kHz": 1e3, "MHz": 1e6},
    "s": SECONDS | {"min": 60.0, "h": 3600.0},
}
NUMBER = re.compile(rf"\s*({A_NUMBER})\s*(\S*)\s*")


def quantity(unit: str, *, above_zero: bool = False) -> Callable[[str], float]:
    """Return the type of an option that is given in ``unit``, with a prefix or not, as SI units."""
    factors = FACTORS[unit]

    def number(text: str) -> float:
        found = NUMBER.fullmatch(in_ascii(text))
        if found is None or found[2] not in factors:
            known = ", ".join(filter(None, factors))
            raise click.BadParameter(f"'{text}' is not a number with a unit: give one of {known}")
        value = float(found[1]) * factors[found[2]]
        if not math.isfinite(value):
            raise click.BadParameter(f"'{text}' is not finite: give a finite number")
        if above_zero and value <= 0.0:
            raise click.BadParameter(f"'{text}' is not above zero: give a positive number")
        return value

    number.__name__ = f"NUMBER {unit}"
    return number


def positive(unit: str) -> Callable[[str], float]:
    """Return the type of an option as ``quantity`` does; it must be above zero."""
    return quantity(unit, above_zero=True)
