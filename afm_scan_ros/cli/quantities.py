"""Options that are a number with its unit, as ``20um`` or ``50 kHz``."""

import re
from collections.abc import Callable

import click

PREFIXES = {"n": 1e-9, "u": 1e-6, "µ": 1e-6, "m": 1e-3, "": 1.0, "k": 1e3, "M": 1e6}
LONGER = {"min": 60.0, "h": 3600.0}
NUMBER = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(\S*)\s*")


def quantity(unit: str) -> Callable[[str], float]:
    """Return the type of an option that is given with ``unit`` and any prefix, as SI units."""
    factors = {f"{prefix}{unit}": factor for prefix, factor in PREFIXES.items()}
    if unit == "s":
        factors |= LONGER

    def number(text: str) -> float:
        found = NUMBER.fullmatch(text)
        if found is None or found[2] not in factors:
            known = ", ".join(factors)
            raise click.BadParameter(f"'{text}' is not a number with a unit: give one of {known}")
        return float(found[1]) * factors[found[2]]

    number.__name__ = f"NUMBER {unit}"
    return number
