"""Units as people write them, to factors that make SI numbers."""

import re
from collections.abc import Mapping

from afm_scan_ros.core.errors import InputError

VOLTS = {"uV": 1e-6, "mV": 1e-3, "V": 1.0, "kV": 1e3}
METRES = {"pm": 1e-12, "nm": 1e-9, "um": 1e-6, "mm": 1e-3, "m": 1.0}
SECONDS = {"ns": 1e-9, "us": 1e-6, "ms": 1e-3, "s": 1.0}
UNITS = VOLTS | METRES | SECONDS

A_NUMBER = r"[-+]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][-+]?\d+)?"
_FORM = re.compile(rf"(?P<factor>{A_NUMBER}|[-+])?\s*(?P<unit>[^\W\d]+)(?:/(?P<per>[^\W\d]+))?")
_IN_NAME = re.compile(
    r"(?P<name>(?:.*?\S)?)\s*"
    r"(?:\[(?P<a>[^][]*)\]|\((?P<b>[^()]*)\)|[/,]\s*(?P<c>\w+)|_(?P<d>[^\W_]+))"
)
_SUFFIXES = {"v": "V", "mv": "mV", "kv": "kV", "uv": "uV"}
"""Suffixes of names, as ``drive_x_v``, are in small letters."""


def is_unit(word: str) -> bool:
    """Whether a word is a unit of volts, metres or seconds."""
    return in_ascii(word) in UNITS


def bare_unit(text: str) -> str:
    """Return the unit in ``text`` without factor and scale, as ``um`` for ``2.5um/V``, or none."""
    form = _FORM.fullmatch(in_ascii(text))
    return form["unit"] if form and form["unit"] in UNITS else ""


def factor_of(text: str, units: Mapping[str, float], what: str) -> float:
    """Return what a number is to be multiplied by: ``um``, ``-um``, ``2.5nm`` or ``8um/V``.

    ``units`` are those that ``what`` has. The number before a unit is what 1 in the column
    stands for; ``/V`` marks a column in volts. Raises InputError naming what was asked for.
    """
    form = _FORM.fullmatch(in_ascii(text))
    unit, per = ("", None) if form is None else (form["unit"], form["per"])
    if form is None or unit not in units or (per is not None and per not in UNITS):
        raise InputError(f"{what}: '{text}' is not a unit of it: {_mend(unit, units)}")
    sign = form["factor"] or "+"
    number = float(f"{sign}1" if sign in {"+", "-"} else sign)
    if number == 0.0:
        raise InputError(f"{what}: '{text}' makes all of it zero: give another factor")
    return number * units[unit] / (1.0 if per is None else UNITS[per])


def _mend(unit: str, units: Mapping[str, float]) -> str:
    if unit in VOLTS and units is METRES:
        return (
            "give the sensor's scale, as 8um/V. Where it is unknown, any will do: all lengths are"
            " then relative to it, and frequencies and drives are not"
        )
    return f"give one of {', '.join(units)}, or with a factor, as 2.5{[*units][-1]}"


def name_and_unit(heading: str) -> tuple[str, str]:
    """Split ``drive [V]``, ``drive (V)``, ``drive/V``, ``drive,V`` or ``drive_v``.

    The unit is empty where there is none; only one in brackets may be unknown.
    """
    form = _IN_NAME.fullmatch(heading)
    if form is None:
        return heading, ""
    unit = in_ascii(next(part for part in form.group("a", "b", "c", "d") if part is not None))
    unit = _SUFFIXES.get(unit, unit)
    bracketed = form["c"] is None and form["d"] is None
    return (form["name"], unit) if bracketed or bare_unit(unit) else (heading, "")


def in_ascii(text: str) -> str:
    """Return a unit with ``u`` for either of the two signs that stand for micro."""
    return text.strip().replace("\N{MICRO SIGN}", "u").replace("\N{GREEK SMALL LETTER MU}", "u")
