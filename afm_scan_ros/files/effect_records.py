"""How a model file holds the base effects of an axis: records, and arrays beside them.

So it holds their spread: its centre as effects, its directions as numbers. Each row of the array
``directions`` holds the numbers of a variant, in SI units and in the order of its fields: those
that the centre has, in the same places.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np
from attrs import evolve, field, fields, frozen, has

from afm_scan_ros.core.effects.sensor import SensorModel
from afm_scan_ros.core.effects.vibration import SENSOR_SENSITIVITY
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.model import (
    CreepModel,
    DuhemSlopes,
    EverettSurface,
    HysteresisModel,
    HysteresisOperator,
    OutputMap,
    VibrationModel,
)
from afm_scan_ros.core.spread import Spread, Variant
from afm_scan_ros.core.types import Array
from afm_scan_ros.files.arrays import Archive
from afm_scan_ros.files.records import naming, recast

Arrays = dict[str, Array]
"""Arrays of an archive, by name."""


@frozen
class SurfaceRecord:
    """An EverettSurface, by the names of its arrays."""

    lower: float = field(metadata={"suffix": "_v"})
    upper: float = field(metadata={"suffix": "_v"})
    offset: float = field(metadata={"suffix": "_v"})
    values: str
    bias: float | None = field(default=None, metadata={"suffix": "_v"})
    uneven: str | None = field(default=None, metadata={"suffix": "_levels"})
    within: tuple[float, float] | None = field(default=None, metadata={"suffix": "_v"})


@frozen
class SlopesRecord:
    """DuhemSlopes; the array ``values`` has the centre, the rising and the falling in columns."""

    lower: float = field(metadata={"suffix": "_v"})
    upper: float = field(metadata={"suffix": "_v"})
    offset: float = field(metadata={"suffix": "_v"})
    rest: float = field(metadata={"suffix": "_v"})
    widths: tuple[float, float] = field(metadata={"suffix": "_v"})
    values: str


@frozen
class MapRecord:
    """An OutputMap."""

    lower: float = field(metadata={"suffix": "_v"})
    upper: float = field(metadata={"suffix": "_v"})
    coefficients: tuple[float, ...] = field(metadata={"suffix": "_v"})


@frozen(kw_only=True)
class HysteresisRecord:
    """With the one or the other operator: ``forward`` is Preisach's, ``duhem`` is Duhem's."""

    forward: SurfaceRecord | None = None
    duhem: SlopesRecord | None = None
    direct: SurfaceRecord
    output: MapRecord | None = None
    inverse: str = "exact"


@frozen
class VibrationRecord:
    """A VibrationModel, as a sensor's output is measured."""

    numerator: tuple[float, ...] = field(metadata={"suffix": "_v_per_v"})
    denominator: tuple[float, ...]
    delay: float = field(default=0.0, metadata={"suffix": "_s"})


@frozen
class CreepRecord:
    """A CreepModel."""

    gains: tuple[float, ...]
    time_constants: tuple[float, ...] = field(metadata={"suffix": "_s"})


@frozen
class SensorRecord:
    """A SensorModel."""

    order: int = 0
    corner: float | None = field(default=None, metadata={"suffix": "_hz"})
    delay: float = field(default=0.0, metadata={"suffix": "_s"})
    reads_after: bool = False


def hysteresis_from(given: HysteresisRecord, arrays: Archive) -> HysteresisModel:
    """Return the hysteresis of a record; raises InputError naming the key and the fix."""
    operator = operator_from(given.forward, given.duhem, arrays)
    with naming("direct"):
        direct = _surface_from(given.direct, arrays)
    behind = None if given.output is None else recast(OutputMap, given.output)
    return HysteresisModel(operator, direct, behind, given.inverse)


def operator_from(
    forward: SurfaceRecord | None, duhem: SlopesRecord | None, arrays: Archive
) -> HysteresisOperator:
    """Return the one of two operators that is given; raises InputError where not one is."""
    if forward is not None and duhem is None:
        with naming("forward"):
            return _surface_from(forward, arrays)
    if duhem is not None and forward is None:
        with naming("duhem"):
            return _slopes_from(duhem, arrays)
    raise InputError("give one operator, forward (Preisach's) or duhem")


def _surface_from(given: SurfaceRecord, arrays: Archive) -> EverettSurface:
    values = arrays.matrix(given.values, square=True)
    uneven = None if given.uneven is None else arrays.matrix(given.uneven).ravel()
    known = values, given.offset, given.bias, uneven, given.within
    return EverettSurface(given.lower, given.upper, *known)


def _slopes_from(given: SlopesRecord, arrays: Archive) -> DuhemSlopes:
    values = arrays.matrix(given.values)
    centre, rising, falling = np.split(values, (1, 1 + values.shape[1] // 2), axis=1)
    outputs = given.offset, given.rest, given.widths
    return DuhemSlopes(given.lower, given.upper, *outputs, centre[:, 0], rising, falling)


def vibration_from(given: VibrationRecord, sensitivity: float) -> VibrationModel:
    """Return the vibration of a record, by a sensor's sensitivity (m/V)."""
    numerator = tuple(c * sensitivity for c in given.numerator)
    return VibrationModel(numerator, given.denominator, given.delay)


def vibration_to(of: VibrationModel) -> VibrationRecord:
    """Return what ``vibration_from`` makes the same from, by the package's own sensitivity."""
    numerator = tuple(c / SENSOR_SENSITIVITY for c in of.numerator)
    return VibrationRecord(numerator, of.denominator, of.delay)


def _surface_to(of: EverettSurface, name: str, arrays: Arrays) -> SurfaceRecord:
    arrays[name] = of.values
    levels = None
    if of.uneven is not None:
        levels = f"{name}_levels"
        arrays[levels] = of.uneven[np.newaxis]
    return SurfaceRecord(of.lower, of.upper, of.offset, name, of.bias, levels, of.within)


def hysteresis_to(model: HysteresisModel, axis: str, arrays: Arrays) -> HysteresisRecord:
    """Return what ``hysteresis_from`` makes the same from; add its arrays to others."""
    given = None if model.output is None else recast(MapRecord, model.output)
    forward, duhem = operator_to(model.forward, axis, arrays)
    direct = _surface_to(model.direct, f"{axis}_direct", arrays)
    return HysteresisRecord(
        forward=forward, duhem=duhem, direct=direct, output=given, inverse=model.inverse
    )


def operator_to(
    of: HysteresisOperator, axis: str, arrays: Arrays
) -> tuple[SurfaceRecord | None, SlopesRecord | None]:
    """Return what ``operator_from`` makes the same from; add its arrays to others."""
    if isinstance(of, EverettSurface):
        return _surface_to(of, f"{axis}_forward", arrays), None
    name = f"{axis}_duhem"
    arrays[name] = np.column_stack([of.centre, of.rising, of.falling])
    return None, SlopesRecord(of.lower, of.upper, of.offset, of.rest, of.widths, name)


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
    rest_known: bool = True


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
    return Spread(centre, directions, given.bands, given.shares, given.rest_known)


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
    return SpreadRecord(centre, f"{name}_directions", of.bands, of.shares, of.rest_known)


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
