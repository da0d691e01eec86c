"""The model file: the model of a scanner in YAML with its arrays in an .npz beside it.

It holds one axis or both.
The YAML states a digest of the arrays, so that it is never read with those of another model.
Polynomials of the vibration stand in V/V, as a sensor's output is measured; the file states the
``sensor_sensitivity_m_per_v`` by which they become m/V. Effects that were added are listed:

added:
- name: delay
  kind: ''
  parameters:
    delay: {value: 2.0e-05, unit: s}
"""

import hashlib
import math
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from attrs import evolve, field, fields, frozen, has
from attrs.validators import ge, in_, le, matches_re

from afm_scan_ros.core.coupled_scanner import CoupledScanner
from afm_scan_ros.core.effects.effect_type import EffectParameter
from afm_scan_ros.core.effects.registry import effect_type
from afm_scan_ros.core.effects.scale import Scale, scale_of
from afm_scan_ros.core.effects.sensor import SensorModel
from afm_scan_ros.core.effects.vibration import SENSOR_SENSITIVITY
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.model import (
    Added,
    AxisModel,
    BaseEffects,
    CreepModel,
    DuhemSlopes,
    EffectStatus,
    EverettSurface,
    HysteresisModel,
    HysteresisOperator,
    ModelDiscrepancy,
    OutputMap,
    ParameterInterval,
    ScannerModel,
    Status,
    VibrationModel,
)
from afm_scan_ros.core.scanner import chain_of
from afm_scan_ros.core.types import AXES, Array
from afm_scan_ros.files import yaml
from afm_scan_ros.files.arrays import Archive
from afm_scan_ros.files.model_pair import arrays_beside, load_sealed, saved_arrays, sealed
from afm_scan_ros.files.records import from_mapping, naming, recast, refuse_unknown, to_mapping

ROOM = 0.01
"""Share of a bound by which a value may exceed it: another identification has another scale."""
Parameters = Sequence[EffectParameter]


@frozen
class AddedEffect:
    """One item of the list; each parameter by its name, as in ``diagnosis.json``."""

    name: str
    kind: str
    parameters: dict[str, Any]


def added_from(items: Iterable[AddedEffect], scale: Scale) -> tuple[Added, ...]:
    """Effects of a file, of a scanner's scale; raises InputError naming item, key and fix."""
    found = []
    for number, item in enumerate(items):
        with naming(f"added[{number}]"):
            form = effect_type(item.name).form(item.kind).at(scale)
            found.append(Added(item.name, form.kind, values_of(item, form.parameters)))
    return tuple(found)


def added_to(effects: Iterable[Added]) -> tuple[AddedEffect, ...]:
    """What ``added_from`` makes the same effects from."""
    return tuple(
        listed(each.name, each.kind, each.values, effect_type(each.name).form(each.kind).parameters)
        for each in effects
    )


def listed(name: str, kind: str, values: Sequence[float], parameters: Parameters) -> AddedEffect:
    """Item of an effect: its values by the names of their parameters, each with its unit."""
    pairs = zip(values, parameters, strict=True)
    return AddedEffect(name, kind, {p.name: {"value": v, "unit": p.unit} for v, p in pairs})


def values_of(item: AddedEffect, parameters: Parameters) -> tuple[float, ...]:
    """Values of an item's parameters in their order; raises InputError naming key and fix."""
    refuse_unknown(item.parameters, (p.name for p in parameters), "parameters")
    with naming("parameters"):
        return tuple(_value(p, item.parameters) for p in parameters)


def _value(parameter: EffectParameter, given: dict[str, Any]) -> float:
    name, unit = parameter.name, parameter.unit
    if name not in given:
        raise InputError(f"key '{name}' is missing; add it")
    stated = given[name]
    if not isinstance(stated, dict) or set(stated) != {"value", "unit"}:
        raise InputError(
            f"{name} = {stated!r} should be a value and a unit, as {{value: 1.0, unit: {unit}}}"
        )
    value = stated["value"]
    if str(stated["unit"]) != unit:
        raise InputError(f"{name}: unit is {stated['unit']!r}, not {unit!r}: convert the value")
    if type(value) is not float or not math.isfinite(value):
        raise InputError(f"{name} = {value!r} should be a number with a point, as 5.0")
    lower = parameter.lower - ROOM * abs(parameter.lower)
    upper = parameter.upper + ROOM * abs(parameter.upper)
    if not lower <= value <= upper:
        raise InputError(
            f"{name} = {value:g} is out of range: from {parameter.lower:g} to {parameter.upper:g}"
        )
    return value


Arrays = dict[str, Array]


@frozen
class _Surface:
    lower: float = field(metadata={"suffix": "_v"})
    upper: float = field(metadata={"suffix": "_v"})
    offset: float = field(metadata={"suffix": "_v"})
    values: str
    bias: float | None = field(default=None, metadata={"suffix": "_v"})
    uneven: str | None = field(default=None, metadata={"suffix": "_levels"})


@frozen
class _Slopes:
    """DuhemSlopes; the array ``values`` has the centre, the rising and the falling in columns."""

    lower: float = field(metadata={"suffix": "_v"})
    upper: float = field(metadata={"suffix": "_v"})
    offset: float = field(metadata={"suffix": "_v"})
    rest: float = field(metadata={"suffix": "_v"})
    widths: tuple[float, float] = field(metadata={"suffix": "_v"})
    values: str


@frozen
class _OutputMap:
    lower: float = field(metadata={"suffix": "_v"})
    upper: float = field(metadata={"suffix": "_v"})
    coefficients: tuple[float, ...] = field(metadata={"suffix": "_v"})


@frozen(kw_only=True)
class _Hysteresis:
    """With the one or the other operator: ``forward`` is Preisach's, ``duhem`` is Duhem's."""

    forward: _Surface | None = None
    duhem: _Slopes | None = None
    direct: _Surface
    output: _OutputMap | None = None
    inverse: str = "exact"


@frozen
class _Vibration:
    numerator: tuple[float, ...] = field(metadata={"suffix": "_v_per_v"})
    denominator: tuple[float, ...]
    delay: float = field(default=0.0, metadata={"suffix": "_s"})


@frozen
class _Creep:
    gains: tuple[float, ...]
    time_constants: tuple[float, ...] = field(metadata={"suffix": "_s"})


NANOMETRES = {"suffix": "_nm", "scale": 1e-9}


@frozen
class _Sensor:
    order: int = 0
    corner: float | None = field(default=None, metadata={"suffix": "_hz"})
    delay: float = field(default=0.0, metadata={"suffix": "_s"})


@frozen
class _ModelDiscrepancy:
    record: str
    bands: tuple[float, ...] = field(metadata={"suffix": "_hz"})
    rms: tuple[float, ...] = field(metadata=NANOMETRES)
    noise_rms: tuple[float, ...] = field(metadata=NANOMETRES)
    displacement_rms: tuple[float, ...] = field(metadata=NANOMETRES)
    fitted: bool = False


def _word(status: Status | str) -> str:
    return Status(status).value


@frozen
class _Effect:
    status: str = field(validator=in_([each.value for each in Status]), converter=_word)
    drive: tuple[float, float] | None = field(default=None, metadata={"suffix": "_v"})
    frequencies: tuple[float, float] | None = field(default=None, metadata={"suffix": "_hz"})
    hold_times: tuple[float, float] | None = field(default=None, metadata={"suffix": "_s"})
    intervals: tuple[ParameterInterval, ...] = ()
    identifiable_from: str = ""


@frozen
class _Effects:
    creep: _Effect
    hysteresis: _Effect
    vibration: _Effect


@frozen
class _Axis:
    hysteresis: _Hysteresis
    vibration: _Vibration
    creep: _Creep
    model_discrepancy: _ModelDiscrepancy | None = None
    added: tuple[AddedEffect, ...] = ()
    known_elsewhere: tuple[_ModelDiscrepancy, ...] = ()
    effects: _Effects | None = None
    sensor: _Sensor | None = None


@frozen
class _File:
    sensor_sensitivity: float = field(
        metadata={"suffix": "_m_per_v"}, validator=[ge(1e-9), le(1e-3)]
    )
    arrays: str = field(validator=matches_re(r"[^/\\]+\.npz"))
    arrays_sha256: str = field(default="", kw_only=True)
    x: _Axis | None = None
    y: _Axis | None = None


def load_model(path: Path) -> ScannerModel:
    """Model of a file; raises InputError naming the file, the key and the fix."""
    content = from_mapping(_File, load_sealed(path), str(path))
    arrays = arrays_beside(path, content.arrays, content.arrays_sha256)
    axes = {}
    with naming(path):
        for name in AXES:
            given: _Axis | None = getattr(content, name)
            if given is not None:
                with naming(name):
                    axes[name] = _axis_from(given, content.sensor_sensitivity, arrays)
        arrays.refuse_others(content.arrays_sha256)
        return _apart(ScannerModel(**axes))


def _apart(model: ScannerModel) -> ScannerModel:
    """Return a model of which no axis moves with one that is absent."""
    for name in model.axes if len(model.axes) < len(AXES) else ():
        if chain_of(model.axis(name)).coupling:
            raise InputError(
                f"{name}: added: an effect couples {name} to the axis that the file lacks: add that"
                " axis, or take the effect out"
            )
    return model


def save_model(path: Path, model: ScannerModel, heading: str) -> None:
    """Write the model and, beside it, its arrays in ``path`` with the ending ``.npz``."""
    arrays: Arrays = {}
    axes = {name: _axis_to(model.axis(name), name, arrays) for name in model.axes}
    with saved_arrays(path, arrays) as (beside, digest):
        content = _File(
            sensor_sensitivity=SENSOR_SENSITIVITY, arrays=beside, arrays_sha256=digest, **axes
        )
        yaml.save(path, sealed(to_mapping(content)), heading)


def model_hash(model: ScannerModel | CoupledScanner) -> str:
    """SHA-256 of every number of the model, the same wherever its files lie.

    The model discrepancy is no part of the model: the inverse is the same with and without it.
    """
    return hashlib.sha256(b"".join(_in_bytes(model))).hexdigest()


def _in_bytes(value: Any) -> Iterator[bytes]:  # noqa: ANN401 - a record or numbers
    if isinstance(value, str):
        yield value.encode()
    elif isinstance(value, tuple) and value and (isinstance(value[0], str) or has(type(value[0]))):
        for each in value:
            yield from _in_bytes(each)
    elif has(type(value)):
        for attribute in (a for a in fields(type(value)) if a.eq):
            if (part := getattr(value, attribute.name)) is not None:
                yield attribute.name.encode()
                yield from _in_bytes(part)
    else:
        numbers = np.asarray(value, dtype="<f8")
        yield repr(numbers.shape).encode() + numbers.tobytes()


def _axis_from(axis: _Axis, sensitivity: float, arrays: Archive) -> AxisModel:
    with naming("hysteresis"):
        hysteresis = _hysteresis_from(axis.hysteresis, arrays)
    numerator = tuple(c * sensitivity for c in axis.vibration.numerator)
    known, given = axis.model_discrepancy, axis.effects
    parts = () if given is None else (given.creep, given.hysteresis, given.vibration)
    model = AxisModel(
        hysteresis,
        VibrationModel(numerator, axis.vibration.denominator, axis.vibration.delay),
        recast(CreepModel, axis.creep),
        None if known is None else recast(ModelDiscrepancy, known),
        (),
        tuple(recast(ModelDiscrepancy, each) for each in axis.known_elsewhere),
        BaseEffects(*(recast(EffectStatus, part) for part in parts)),
        None if axis.sensor is None else recast(SensorModel, axis.sensor),
    )
    model = evolve(model, added=added_from(axis.added, scale_of(model)))
    chain_of(model)  # raises where added effects cannot stand beside each other
    return model


def _hysteresis_from(given: _Hysteresis, arrays: Archive) -> HysteresisModel:
    operator = _operator_from(given, arrays)
    with naming("direct"):
        direct = _surface_from(given.direct, arrays)
    behind = None if given.output is None else recast(OutputMap, given.output)
    return HysteresisModel(operator, direct, behind, given.inverse)


def _operator_from(given: _Hysteresis, arrays: Archive) -> HysteresisOperator:
    if given.forward is not None and given.duhem is None:
        with naming("forward"):
            return _surface_from(given.forward, arrays)
    if given.duhem is not None and given.forward is None:
        with naming("duhem"):
            return _slopes_from(given.duhem, arrays)
    raise InputError("give one operator, forward (Preisach's) or duhem")


def _surface_from(given: _Surface, arrays: Archive) -> EverettSurface:
    values = arrays.matrix(given.values, square=True)
    uneven = None if given.uneven is None else arrays.matrix(given.uneven).ravel()
    return EverettSurface(given.lower, given.upper, values, given.offset, given.bias, uneven)


def _slopes_from(given: _Slopes, arrays: Archive) -> DuhemSlopes:
    values = arrays.matrix(given.values)
    centre, rising, falling = np.split(values, (1, 1 + values.shape[1] // 2), axis=1)
    outputs = given.offset, given.rest, given.widths
    return DuhemSlopes(given.lower, given.upper, *outputs, centre[:, 0], rising, falling)


def _axis_to(axis: AxisModel, name: str, arrays: Arrays) -> _Axis:
    known = axis.model_discrepancy
    numerator = tuple(c / SENSOR_SENSITIVITY for c in axis.vibration.numerator)
    return _Axis(
        _hysteresis_to(axis.hysteresis, name, arrays),
        _Vibration(numerator, axis.vibration.denominator, axis.vibration.delay),
        recast(_Creep, axis.creep),
        None if known is None else recast(_ModelDiscrepancy, known),
        added_to(axis.added),
        tuple(recast(_ModelDiscrepancy, each) for each in axis.known_elsewhere),
        _Effects(*(recast(_Effect, status) for _, status in axis.effects.each())),
        None if axis.sensor is None else recast(_Sensor, axis.sensor),
    )


def _surface_to(of: EverettSurface, name: str, arrays: Arrays) -> _Surface:
    arrays[name] = of.values
    levels = None
    if of.uneven is not None:
        levels = f"{name}_levels"
        arrays[levels] = of.uneven[np.newaxis]
    return _Surface(of.lower, of.upper, of.offset, name, of.bias, levels)


def _hysteresis_to(model: HysteresisModel, axis: str, arrays: Arrays) -> _Hysteresis:
    behind, of = model.output, model.forward
    given = None if behind is None else recast(_OutputMap, behind)
    forward = duhem = None
    if isinstance(of, EverettSurface):
        forward = _surface_to(of, f"{axis}_forward", arrays)
    else:
        name = f"{axis}_duhem"
        arrays[name] = np.column_stack([of.centre, of.rising, of.falling])
        duhem = _Slopes(of.lower, of.upper, of.offset, of.rest, of.widths, name)
    direct = _surface_to(model.direct, f"{axis}_direct", arrays)
    return _Hysteresis(
        forward=forward, duhem=duhem, direct=direct, output=given, inverse=model.inverse
    )
