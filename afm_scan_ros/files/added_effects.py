"""Effects that were added to a model, as the model file lists them.

added:
- name: delay
  kind: ''
  parameters:
    delay: {value: 2.0e-05, unit: s}
"""

import math
from collections.abc import Iterable, Sequence
from typing import Any

from attrs import frozen

from afm_scan_ros.core.effects.effect_type import EffectParameter
from afm_scan_ros.core.effects.registry import effect_type
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.model import Added
from afm_scan_ros.files.records import refuse_unknown

FORMER_KINDS = {
    ("cross_coupling", "leg"): "coupled_mode",
    ("extra_resonance", "absorber"): "absorber_mode",
    ("extra_resonance", "rider"): "series_mode",
}
"""Kinds of earlier files, by what they are called now."""


Parameters = Sequence[EffectParameter]


@frozen
class AddedEffect:
    """One item of the list; each parameter by its name, as in ``diagnosis.json``."""

    name: str
    kind: str
    parameters: dict[str, Any]


def added_from(items: Iterable[AddedEffect], where: str) -> tuple[Added, ...]:
    """Effects of a file; raises InputError naming ``where``, the key and the fix."""
    return tuple(_added(item, f"{where}: added[{i}]") for i, item in enumerate(items))


def added_to(effects: Iterable[Added]) -> tuple[AddedEffect, ...]:
    """What ``added_from`` makes the same effects from."""
    return tuple(_item(each) for each in effects)


def former_key(parameter: EffectParameter) -> str:
    """Key by which earlier files give a number alone, as ``rate_m_per_s``."""
    if parameter.unit == "1":
        return parameter.name
    return f"{parameter.name}_{parameter.unit.replace('/', '_per_').lower()}"


def _item(effect: Added) -> AddedEffect:
    parameters = effect_type(effect.name).form(effect.kind).parameters
    return AddedEffect(effect.name, effect.kind, mapping_of(effect.values, parameters))


def mapping_of(values: Sequence[float], parameters: Parameters) -> dict[str, Any]:
    """Values by the names of their parameters, each with its unit."""
    return {p.name: {"value": v, "unit": p.unit} for p, v in zip(parameters, values, strict=True)}


def _added(item: AddedEffect, where: str) -> Added:
    try:
        form = effect_type(item.name).form(FORMER_KINDS.get((item.name, item.kind), item.kind))
    except InputError as error:
        raise InputError(f"{where}: {error}") from error
    return Added(item.name, form.kind, values_of(item, form.parameters, where))


def values_of(item: AddedEffect, parameters: Parameters, where: str) -> tuple[float, ...]:
    """Values of an item's parameters in their order; raises InputError as ``added_from``."""
    given, where = item.parameters, f"{where}: parameters"
    numbers = not any(isinstance(each, dict) for each in given.values())
    if given and numbers and set(given) <= {former_key(p) for p in parameters}:
        return tuple(_value(p, _of_key(former_key(p), given, where), where) for p in parameters)
    refuse_unknown(given, (p.name for p in parameters), where)
    return tuple(_value(p, _of_unit(p, given, where), where) for p in parameters)


def _of_key(key: str, given: dict[str, Any], where: str) -> Any:  # noqa: ANN401 - of a file
    if key not in given:
        raise InputError(f"{where}: key '{key}' is missing; add it")
    return given[key]


def _of_unit(parameter: EffectParameter, given: dict[str, Any], where: str) -> Any:  # noqa: ANN401 - of a file
    """Return the number given for a parameter, once its unit is found to be right."""
    said = _of_key(parameter.name, given, where)
    if not isinstance(said, dict) or set(said) != {"value", "unit"}:
        raise InputError(
            f"{where}: {parameter.name} = {said!r} should be a value and a unit,"
            f" as {{value: 1.0, unit: {parameter.unit}}}"
        )
    if str(said["unit"]) != parameter.unit:
        raise InputError(
            f"{where}: {parameter.name}: unit is {said['unit']!r}, not {parameter.unit!r}: convert"
            " the value"
        )
    return said["value"]


def _value(parameter: EffectParameter, value: Any, where: str) -> float:  # noqa: ANN401 - of a file
    name = parameter.name
    if type(value) is not float or not math.isfinite(value):
        raise InputError(f"{where}: {name} = {value!r} should be a number with a point, as 5.0")
    if not parameter.lower <= value <= parameter.upper:
        raise InputError(
            f"{where}: {name} = {value:g} is out of range: from {parameter.lower:g} to"
            f" {parameter.upper:g}"
        )
    return value
