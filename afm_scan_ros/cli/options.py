"""What the options of several commands have in common: paths, and numbers with a unit."""

import math
import re
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

import click

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.files.share import share_directory

CONFIG = share_directory() / "config"

FILE = click.Path(dir_okay=False, path_type=Path)
FOLDER = click.Path(file_okay=False, path_type=Path)
RECORD = click.Path(path_type=Path)
"""A rosbag2 folder or an .mcap file."""


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
    "m": {"nm": 1e-9, "um": 1e-6, "µm": 1e-6, "mm": 1e-3, "m": 1.0},
    "V": {"mV": 1e-3, "V": 1.0, "kV": 1e3},
    "Hz": {"": 1.0, "Hz": 1.0, "kHz": 1e3, "MHz": 1e6},
    "s": {"ms": 1e-3, "s": 1.0, "min": 60.0, "h": 3600.0},
}
NUMBER = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(\S*)\s*")


def quantity(unit: str) -> Callable[[str], float]:
    """Return the type of an option that is given in ``unit``, with a prefix or not, as SI units."""
    factors = FACTORS[unit]

    def number(text: str) -> float:
        found = NUMBER.fullmatch(text)
        if found is None or found[2] not in factors:
            known = ", ".join(filter(None, factors))
            raise click.BadParameter(f"'{text}' is not a number with a unit: give one of {known}")
        value = float(found[1]) * factors[found[2]]
        if not math.isfinite(value):
            raise click.BadParameter(f"'{text}' is not finite: give a finite number")
        return value

    number.__name__ = f"NUMBER {unit}"
    return number


def positive(unit: str) -> Callable[[str], float]:
    """Return the type of an option as ``quantity`` does; it must be above zero."""
    number = quantity(unit)

    def above_zero(text: str) -> float:
        value = number(text)
        if value <= 0.0:
            raise click.BadParameter(f"'{text}' is not above zero: give a positive number")
        return value

    above_zero.__name__ = number.__name__
    return above_zero
