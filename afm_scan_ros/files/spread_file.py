"""How a model file holds the spread of an axis: its centre as effects, its directions as numbers.

Each row of the array ``directions`` holds the numbers of a variant, in SI units and in the order of
its fields: those that the centre has, in the same places.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np
from attrs import evolve, field, fields, frozen, has

from afm_scan_ros.core.effects.sensor import SensorModel
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.model import CreepModel, OutputMap
from afm_scan_ros.core.spread import Spread, Variant
from afm_scan_ros.core.types import Array
from afm_scan_ros.files.arrays import Archive
from afm_scan_ros.files.effect_records import (
    Arrays,
    CreepRecord,
    MapRecord,
    SensorRecord,
    SlopesRecord,
    SurfaceRecord,
    VibrationRecord,
    operator_from,
    operator_to,
    vibration_from,
    vibration_to,
)
from afm_scan_ros.files.records import naming, recast


@frozen(kw_only=True)
class CentreRecord:
    """The effects of the centre; its operator is the one or the other."""

    forward: SurfaceRecord | None = None
    duhem: SlopesRecord | None = None
    output: MapRecord | None = None
    vibration: VibrationRecord
    creep: CreepRecord
    sensor: SensorRecord | None = None


@frozen
class SpreadRecord:
    """A Spread, by the name of the array of its directions."""

    centre: CentreRecord
    directions: str
    bands: tuple[float, ...] = field(metadata={"suffix": "_hz"})
    shares: tuple[float, ...]
    of_rest: bool = True


def spread_from(given: SpreadRecord, sensitivity: float, arrays: Archive) -> Spread:
    """Return the spread of a record; raises InputError naming the key and the fix."""
    one = given.centre
    with naming("centre"):
        centre = Variant(
            operator_from(one.forward, one.duhem, arrays),
            None if one.output is None else recast(OutputMap, one.output),
            vibration_from(one.vibration, sensitivity),
            recast(CreepModel, one.creep),
            None if one.sensor is None else recast(SensorModel, one.sensor),
        )
    rows, expected = arrays.matrix(given.directions), len(numbers_of(centre))
    if rows.shape[1] != expected:
        raise InputError(
            f"'{given.directions}' holds {rows.shape[1]} numbers a direction, and the centre has"
            f" {expected}: bring both back from one file, or take the spread out"
        )
    with naming("directions"):
        directions = tuple(_like(centre, iter(row)) for row in rows)
    return Spread(centre, directions, given.bands, given.shares, given.of_rest)


def spread_to(of: Spread, axis: str, arrays: Arrays) -> SpreadRecord:
    """Return what ``spread_from`` makes the same from; add its arrays to others."""
    one, name = of.centre, f"{axis}_spread"
    forward, duhem = operator_to(one.forward, name, arrays)
    centre = CentreRecord(
        forward=forward,
        duhem=duhem,
        output=None if one.output is None else recast(MapRecord, one.output),
        vibration=vibration_to(one.vibration),
        creep=recast(CreepRecord, one.creep),
        sensor=None if one.sensor is None else recast(SensorRecord, one.sensor),
    )
    rows = [numbers_of(each) for each in of.directions]
    arrays[f"{name}_directions"] = np.reshape(rows, (len(rows), len(numbers_of(one))))
    return SpreadRecord(centre, f"{name}_directions", of.bands, of.shares, of.of_rest)


def numbers_of(value: Any) -> Array:  # noqa: ANN401 - a record or numbers
    """All numbers of a record that may vary, in the order of its fields, (n,)."""
    if value is None or isinstance(value, int):
        return np.zeros(0)
    if has(type(value)):
        parts = [numbers_of(getattr(value, each.name)) for each in fields(type(value)) if each.init]
        return np.concatenate([np.zeros(0), *parts])
    return np.ravel(np.asarray(value, dtype=np.float64))


def _like(pattern: Any, numbers: Iterator[float]) -> Any:  # noqa: ANN401 - as the pattern
    """Return what the next numbers make of a pattern: a record, an array, a tuple or a float."""
    if pattern is None or isinstance(pattern, int):
        return pattern
    if has(type(pattern)):
        names = [each.name for each in fields(type(pattern)) if each.init]
        return evolve(pattern, **{n: _like(getattr(pattern, n), numbers) for n in names})
    if isinstance(pattern, float):
        return float(next(numbers))
    taken = [float(next(numbers)) for _ in range(np.size(pattern))]
    return np.reshape(taken, pattern.shape) if isinstance(pattern, np.ndarray) else tuple(taken)
