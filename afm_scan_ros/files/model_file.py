"""The model file: the model of a scanner in YAML with its arrays in an .npz beside it.

It holds one axis or both.
The YAML states a digest of the arrays, so that it is never read with those of another model.
Polynomials of the vibration stand in V/V, as a sensor's output is measured; the file states the
``sensor_sensitivity_m_per_v`` by which they become m/V.
"""

import hashlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from attrs import astuple, field, fields, frozen, has
from attrs.validators import ge, in_, le, matches_re

from afm_scan_ros.core.effect_status import (
    BaseEffects,
    EffectStatus,
    ParameterInterval,
    Status,
)
from afm_scan_ros.core.effects.hysteresis.operators import HysteresisOperator
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.model import (
    AxisModel,
    CreepModel,
    DuhemSlopes,
    EverettSurface,
    HysteresisModel,
    ModelDiscrepancy,
    OutputMap,
    ScannerModel,
    VibrationModel,
)
from afm_scan_ros.core.paper import SENSOR_SENSITIVITY
from afm_scan_ros.core.scanner import chain_of
from afm_scan_ros.core.types import AXES, Array
from afm_scan_ros.files import yaml
from afm_scan_ros.files.added_effects import AddedEffect, added_from, added_to
from afm_scan_ros.files.arrays import Archive
from afm_scan_ros.files.records import from_mapping, to_mapping

Arrays = dict[str, Array]


@frozen
class _Surface:
    lower: float = field(metadata={"suffix": "_v"})
    upper: float = field(metadata={"suffix": "_v"})
    offset: float = field(metadata={"suffix": "_v"})
    values: str
    bias: float | None = field(default=None, metadata={"suffix": "_v"})


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
class _ModelDiscrepancy:
    record: str
    bands: tuple[float, ...] = field(metadata={"suffix": "_hz"})
    rms: tuple[float, ...] = field(metadata=NANOMETRES)
    noise_rms: tuple[float, ...] = field(metadata=NANOMETRES)
    displacement_rms: tuple[float, ...] = field(metadata=NANOMETRES)


@frozen
class _Effect:
    status: str = field(validator=in_([status.value for status in Status]))
    drive: tuple[float, float] | None = field(default=None, metadata={"suffix": "_v"})
    frequencies: tuple[float, float] | None = field(default=None, metadata={"suffix": "_hz"})
    hold_times: tuple[float, float] | None = field(default=None, metadata={"suffix": "_s"})
    intervals: tuple[ParameterInterval, ...] = ()
    told_by: str = ""


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
    content = from_mapping(_File, yaml.load(path), str(path))
    arrays = Archive(path.parent / content.arrays)
    given = {name: getattr(content, name) for name in AXES if getattr(content, name) is not None}
    axes = {
        name: _axis_from(axis, content.sensor_sensitivity, arrays, f"{path}: {name}")
        for name, axis in given.items()
    }
    if content.arrays_sha256 not in ("", arrays.sha256()):
        raise InputError(
            f"{path}: arrays_sha256 is not that of {content.arrays}, so these arrays are of another"
            " model: restore its own arrays, or delete arrays_sha256 if these are right"
        )
    if unread := arrays.unread():
        raise InputError(
            f"{path}: {content.arrays} holds {', '.join(unread)}, which the file does not name:"
            " bring the whole file back, or take these arrays out"
        )
    try:
        return _apart(ScannerModel(**axes))
    except InputError as error:
        raise InputError(f"{path}: {error}") from error


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
    beside = path.with_suffix(".npz")
    np.savez(beside, **arrays)  # type: ignore[arg-type] # its stub takes a name for an option
    content = _File(
        sensor_sensitivity=SENSOR_SENSITIVITY,
        arrays=beside.name,
        arrays_sha256=Archive(beside).sha256(),
        **axes,
    )
    yaml.save(path, to_mapping(content), heading)


def model_hash(model: ScannerModel) -> str:
    """SHA-256 of every number of the model, the same wherever its files lie.

    The model discrepancy is no part of the model: the inverse is the same with and without it.
    """
    digest = hashlib.sha256()
    _digest(digest, model)
    return digest.hexdigest()


class _Digest(Protocol):
    def update(self, data: bytes, /) -> None: ...


def _digest(digest: _Digest, value: Any) -> None:  # noqa: ANN401 - a record or numbers
    if isinstance(value, str):
        digest.update(value.encode())
        return
    if isinstance(value, tuple) and value and has(type(value[0])):
        for each in value:
            _digest(digest, each)
        return
    if has(type(value)):
        for attribute in (a for a in fields(type(value)) if a.eq):
            if (part := getattr(value, attribute.name)) is not None:
                digest.update(attribute.name.encode())
                _digest(digest, part)
        return
    numbers = np.asarray(value, dtype="<f8")
    digest.update(repr(numbers.shape).encode() + numbers.tobytes())


def _axis_from(axis: _Axis, sensitivity: float, arrays: Archive, where: str) -> AxisModel:
    hysteresis = _hysteresis_from(axis.hysteresis, arrays, f"{where}: hysteresis")
    try:
        numerator = tuple(c * sensitivity for c in axis.vibration.numerator)
        vibration = VibrationModel(numerator, axis.vibration.denominator, axis.vibration.delay)
        creep = CreepModel(axis.creep.gains, axis.creep.time_constants)
        given = axis.model_discrepancy
        known = None if given is None else ModelDiscrepancy(*astuple(given))
        elsewhere = tuple(ModelDiscrepancy(*astuple(each)) for each in axis.known_elsewhere)
        effects = _effects_from(axis.effects)
    except ValueError as error:
        raise InputError(f"{where}: {error}") from error
    added = added_from(axis.added, where)
    model = AxisModel(hysteresis, vibration, creep, known, added, elsewhere, effects)
    return _possible(model, where)


def _effects_from(given: _Effects | None) -> BaseEffects:
    if given is None:
        return BaseEffects()
    parts = (given.creep, given.hysteresis, given.vibration)
    return BaseEffects(*(EffectStatus(*astuple(part, recurse=False)) for part in parts))


def _effects_to(effects: BaseEffects) -> _Effects:
    parts = (effects.creep, effects.hysteresis, effects.vibration)
    rows = (astuple(part, recurse=False) for part in parts)
    return _Effects(*(_Effect(status.value, *rest) for status, *rest in rows))


def _hysteresis_from(given: _Hysteresis, arrays: Archive, where: str) -> HysteresisModel:
    operator = _operator_from(given, arrays, where)
    with _naming(f"{where}: direct"):
        direct = _surface_from(given.direct, arrays)
    with _naming(where):
        behind = None if given.output is None else OutputMap(*astuple(given.output))
        return HysteresisModel(operator, direct, behind, given.inverse)


def _operator_from(given: _Hysteresis, arrays: Archive, where: str) -> HysteresisOperator:
    if given.forward is not None and given.duhem is None:
        with _naming(f"{where}: forward"):
            return _surface_from(given.forward, arrays)
    if given.duhem is not None and given.forward is None:
        with _naming(f"{where}: duhem"):
            return _slopes_from(given.duhem, arrays)
    raise InputError(f"{where}: give one operator, forward (Preisach's) or duhem")


@contextmanager
def _naming(where: str) -> Iterator[None]:
    """Begin what is raised by the place in the file."""
    try:
        yield
    except ValueError as error:
        raise InputError(f"{where}: {error}") from error


def _surface_from(given: _Surface, arrays: Archive) -> EverettSurface:
    values = arrays.square(given.values)
    return EverettSurface(given.lower, given.upper, values, given.offset, given.bias)


def _surface_to(given: EverettSurface, name: str, arrays: Arrays) -> _Surface:
    arrays[name] = given.values
    return _Surface(given.lower, given.upper, given.offset, name, given.bias)


def _slopes_from(given: _Slopes, arrays: Archive) -> DuhemSlopes:
    centre, rising, falling = np.split(values := arrays.matrix(given.values), _cuts(values), axis=1)
    outputs = given.offset, given.rest, given.widths
    return DuhemSlopes(given.lower, given.upper, *outputs, centre[:, 0], rising, falling)


def _cuts(values: Array) -> tuple[int, int]:
    """Columns where the rising and the falling slopes begin."""
    return 1, 1 + values.shape[1] // 2


def _slopes_to(given: DuhemSlopes, name: str, arrays: Arrays) -> _Slopes:
    arrays[name] = np.column_stack([given.centre, given.rising, given.falling])
    return _Slopes(given.lower, given.upper, given.offset, given.rest, given.widths, name)


def _possible(axis: AxisModel, where: str) -> AxisModel:
    """Return an axis whose added effects can stand beside each other."""
    try:
        chain_of(axis)
    except InputError as error:
        raise InputError(f"{where}: {error}") from error
    return axis


def _axis_to(axis: AxisModel, name: str, arrays: Arrays) -> _Axis:
    known = axis.model_discrepancy
    numerator = tuple(c / SENSOR_SENSITIVITY for c in axis.vibration.numerator)
    return _Axis(
        _hysteresis_to(axis.hysteresis, name, arrays),
        _Vibration(numerator, axis.vibration.denominator, axis.vibration.delay),
        _Creep(axis.creep.gains, axis.creep.time_constants),
        None if known is None else _ModelDiscrepancy(*astuple(known)),
        added_to(axis.added),
        tuple(_ModelDiscrepancy(*astuple(each)) for each in axis.known_elsewhere),
        _effects_to(axis.effects),
    )


def _hysteresis_to(model: HysteresisModel, axis: str, arrays: Arrays) -> _Hysteresis:
    behind, operator = model.output, model.forward
    given = None if behind is None else _OutputMap(behind.lower, behind.upper, behind.coefficients)
    forward = duhem = None
    if isinstance(operator, EverettSurface):
        forward = _surface_to(operator, f"{axis}_forward", arrays)
    else:
        duhem = _slopes_to(operator, f"{axis}_duhem", arrays)
    direct = _surface_to(model.direct, f"{axis}_direct", arrays)
    return _Hysteresis(
        forward=forward, duhem=duhem, direct=direct, output=given, inverse=model.inverse
    )
