"""Options that are a number with its unit, as ``20um`` or ``50 kHz``."""

import math
import re
from collections.abc import Callable, Mapping

import click

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
