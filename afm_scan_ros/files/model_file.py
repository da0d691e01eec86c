"""The model file: the model of a scanner in YAML with its arrays in an .npz beside it.

It holds one axis or both.
The YAML states a digest of the arrays, so that it is never read with those of another model, and
one of all else in it, so that no part of it passes for the whole.
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
    EffectStatus,
    ModelDiscrepancy,
    ParameterInterval,
    ScannerModel,
    Status,
)
from afm_scan_ros.core.scanner import chain_of
from afm_scan_ros.core.types import AXES
from afm_scan_ros.files import effect_records as base
from afm_scan_ros.files import yaml
from afm_scan_ros.files.arrays import Archive, arrays_beside, load_sealed, saved_arrays, sealed
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


NANOMETRES = {"suffix": "_nm", "scale": 1e-9}


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
    hysteresis: base.HysteresisRecord
    vibration: base.VibrationRecord
    creep: base.CreepRecord
    model_discrepancy: _ModelDiscrepancy | None = None
    added: tuple[AddedEffect, ...] = ()
    known_elsewhere: tuple[_ModelDiscrepancy, ...] = ()
    effects: _Effects | None = None
    sensor: base.SensorRecord | None = None
    spread: base.SpreadRecord | None = None


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
    arrays: base.Arrays = {}
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
        hysteresis = base.hysteresis_from(axis.hysteresis, arrays)
    known, given, apart = axis.model_discrepancy, axis.effects, axis.spread
    with naming("spread"):
        spread = None if apart is None else base.spread_from(apart, sensitivity, arrays)
    parts = () if given is None else (given.creep, given.hysteresis, given.vibration)
    model = AxisModel(
        hysteresis,
        base.vibration_from(axis.vibration, sensitivity),
        recast(CreepModel, axis.creep),
        None if known is None else recast(ModelDiscrepancy, known),
        (),
        tuple(recast(ModelDiscrepancy, each) for each in axis.known_elsewhere),
        BaseEffects(*(recast(EffectStatus, part) for part in parts)),
        None if axis.sensor is None else recast(SensorModel, axis.sensor),
        spread,
    )
    model = evolve(model, added=added_from(axis.added, scale_of(model)))
    chain_of(model)  # raises where added effects cannot stand beside each other
    return model


def _axis_to(axis: AxisModel, name: str, arrays: base.Arrays) -> _Axis:
    known = axis.model_discrepancy
    return _Axis(
        base.hysteresis_to(axis.hysteresis, name, arrays),
        base.vibration_to(axis.vibration),
        recast(base.CreepRecord, axis.creep),
        None if known is None else recast(_ModelDiscrepancy, known),
        added_to(axis.added),
        tuple(recast(_ModelDiscrepancy, each) for each in axis.known_elsewhere),
        _Effects(*(recast(_Effect, status) for _, status in axis.effects.each())),
        None if axis.sensor is None else recast(base.SensorRecord, axis.sensor),
        None if axis.spread is None else base.spread_to(axis.spread, name, arrays),
    )
