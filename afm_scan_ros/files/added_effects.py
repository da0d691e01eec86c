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
from afm_scan_ros.core.effects.scale import Scale
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.model import Added
from afm_scan_ros.files.records import naming, refuse_unknown

FORMER_KINDS = {
    ("cross_coupling", "leg"): "coupled_mode",
    ("extra_resonance", "absorber"): "absorber_mode",
    ("extra_resonance", "rider"): "series_mode",
}
"""Kinds of earlier files, by what they are called now."""

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
            kind = FORMER_KINDS.get((item.name, item.kind), item.kind)
            form = effect_type(item.name).form(kind).at(scale)
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


def former_key(parameter: EffectParameter) -> str:
    """Key by which earlier files give a number alone, as ``rate_m_per_s``."""
    if parameter.unit == "1":
        return parameter.name
    return f"{parameter.name}_{parameter.unit.replace('/', '_per_').lower()}"


def values_of(item: AddedEffect, parameters: Parameters) -> tuple[float, ...]:
    """Values of an item's parameters in their order; raises InputError naming key and fix."""
    given = item.parameters
    former = {former_key(p): p for p in parameters}
    numbers = not any(isinstance(each, dict) for each in given.values())
    if given and numbers and set(given) <= set(former):
        pairs = ((former[key], value) for key, value in given.items())
        given = {p.name: {"value": value, "unit": p.unit} for p, value in pairs}
    refuse_unknown(given, (p.name for p in parameters), "parameters")
    with naming("parameters"):
        return tuple(_value(p, given) for p in parameters)


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
