"""What a person says of a table's columns: ``drive_x=1:V,achieved_x=5:um,time=Clock:ms``."""

from attrs import frozen

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import AXES

QUANTITIES = {
    "drive": "drive_voltage",
    "achieved": "achieved_displacement",
    "desired": "desired_displacement",
}
"""Quantities that a column may hold, and the stream that each becomes."""

TIME = "time"
VOLTS = {"uV": 1e-6, "µV": 1e-6, "mV": 1e-3, "V": 1.0, "kV": 1e3}
METRES = {"pm": 1e-12, "nm": 1e-9, "um": 1e-6, "µm": 1e-6, "mm": 1e-3, "m": 1.0}
SECONDS = {"ns": 1e-9, "us": 1e-6, "µs": 1e-6, "ms": 1e-3, "s": 1.0}


@frozen
class Column:
    """A column: ``name`` as ``drive_x`` or ``time``, ``place`` (number or heading), SI scale."""

    name: str
    place: str
    scale: float


def parse_columns(text: str) -> tuple[Column, ...]:
    """Read ``NAME=PLACE:UNIT`` with commas between. Raises InputError naming the part and mend."""
    columns = tuple(_column(part.strip()) for part in text.split(","))
    names = [column.name for column in columns]
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"columns: {name} is given twice: name one column for it")
    return columns


def _column(part: str) -> Column:
    name, _, rest = part.partition("=")
    place, _, unit = rest.rpartition(":")
    if not (name and place and unit):
        raise InputError(f"columns: '{part}' is not of the form NAME=COLUMN:UNIT, as drive_x=1:V")
    units = _units_of(name)
    if unit not in units:
        raise InputError(
            f"columns: {name} in '{unit}', which is no unit of it: give one of {', '.join(units)}"
        )
    return Column(name, place, units[unit])


def _units_of(name: str) -> dict[str, float]:
    quantity, _, axis = name.partition("_")
    if name == TIME:
        return SECONDS
    if quantity not in QUANTITIES or axis not in AXES:
        known = ", ".join(f"{quantity}_{axis}" for quantity in QUANTITIES for axis in AXES)
        raise InputError(f"columns: '{name}' is no quantity: give some of {TIME}, {known}")
    return VOLTS if quantity == "drive" else METRES
