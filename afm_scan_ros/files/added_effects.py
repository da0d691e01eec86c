"""Effects that were added to a model, as the model file lists them.

added:
- {name: delay, kind: '', parameters: {delay_s: 2.0e-05}}
"""

import math
from collections.abc import Iterable
from typing import Any

from attrs import frozen

from afm_scan_ros.core.effects.entry import Parameter
from afm_scan_ros.core.effects.registry import entry
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.model import Added
from afm_scan_ros.files.records import refuse_unknown


@frozen
class AddedEffect:
    """One item of the list; the parameters' keys end in their units."""

    name: str
    kind: str
    parameters: dict[str, Any]


def added_from(items: Iterable[AddedEffect], where: str) -> tuple[Added, ...]:
    """Effects of a file; raises InputError naming ``where``, the key and the fix."""
    return tuple(_added(item, f"{where}: added[{i}]") for i, item in enumerate(items))


def added_to(effects: Iterable[Added]) -> tuple[AddedEffect, ...]:
    """What ``added_from`` makes the same effects from."""
    return tuple(
        AddedEffect(e.name, e.kind, dict(zip(_keys(e), e.values, strict=True))) for e in effects
    )


def key_of(parameter: Parameter) -> str:
    """Name of a parameter where people write it, as in ``rate_m_per_s``."""
    if parameter.unit == "1":
        return parameter.name
    return f"{parameter.name}_{parameter.unit.replace('/', '_per_').lower()}"


def _keys(effect: Added) -> list[str]:
    return [key_of(p) for p in entry(effect.name).form(effect.kind).parameters]


def _added(item: AddedEffect, where: str) -> Added:
    try:
        parameters = entry(item.name).form(item.kind).parameters
    except InputError as error:
        raise InputError(f"{where}: {error}") from error
    refuse_unknown(item.parameters, (key_of(p) for p in parameters), f"{where}: parameters")
    values = tuple(_value(p, item.parameters, f"{where}: parameters") for p in parameters)
    return Added(item.name, item.kind, values)


def _value(parameter: Parameter, given: dict[str, Any], where: str) -> float:
    key = key_of(parameter)
    if key not in given:
        raise InputError(f"{where}: key '{key}' is missing; add it")
    value = given[key]
    if type(value) is not float or not math.isfinite(value):
        raise InputError(f"{where}: {key} = {value!r} should be a number with a point, as 5.0")
    if not parameter.lower <= value <= parameter.upper:
        raise InputError(
            f"{where}: {key} = {value:g} is out of range: from {parameter.lower:g} to"
            f" {parameter.upper:g}"
        )
    return value
