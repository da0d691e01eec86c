"""Mappings as people write them, to frozen attrs records in SI units and back.

A field's metadata states how people write it: ``suffix`` ends the key (``_um``) and ``scale`` times
the number written is the SI value. Nested records and tuples of them are read in the same way; a
field ``X | None`` may be left out.
"""

import difflib
import math
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from types import UnionType
from typing import Any, TypeVar, get_args, get_origin, get_type_hints

from attrs import NOTHING, Attribute, AttrsInstance, fields, has

from afm_scan_ros.core.errors import InputError

Record = TypeVar("Record", bound=AttrsInstance)

_WORDS = {
    float: "a number with a point, as 5.0",
    int: "a whole number",
    str: "text",
    bool: "true or false",
}


@contextmanager
def naming(where: object) -> Iterator[None]:
    """Raise what is wrong with a value as an InputError that begins with where the value stands."""
    try:
        yield
    except ValueError as error:
        raise InputError(f"{where}: {error}") from error


def recast(cls: type[Record], record: Any) -> Record:
    """Make a record of another class whose fields have the same order as those given to this."""
    return cls(*(getattr(record, each.name) for each in fields(type(record)) if each.init))


def key_of(attribute: "Attribute[Any]") -> str:
    """Name of a field where people write it: with its unit, as in ``range_x_um``."""
    return attribute.name + str(attribute.metadata.get("suffix", ""))


def from_mapping(cls: type[Record], mapping: object, where: str) -> Record:
    """Make a record of ``cls`` from what a file or command line gave.

    Raises InputError naming ``where``, the key, and the fix: for a key that is unknown, missing,
    ill-typed, not finite or out of range, and for whatever the record itself refuses.
    """
    if not isinstance(mapping, Mapping):
        raise InputError(f"{where}: expected 'key: value' lines, found {mapping!r}")
    attributes = fields(cls)
    refuse_unknown(mapping, (key_of(a) for a in attributes), where)
    hints = get_type_hints(cls)
    values = {
        a.name: _field(a, hints[a.name], mapping[key_of(a)], f"{where}: {key_of(a)}")
        for a in attributes
        if _given(a, mapping, where)
    }
    with naming(where):
        return cls(**values)


def to_mapping(record: Any) -> dict[str, Any]:
    """Return what ``from_mapping`` makes the same record from."""
    return {
        key_of(a): _plain(getattr(record, a.name), float(a.metadata.get("scale", 1.0)))
        for a in fields(type(record))
        if getattr(record, a.name) is not None
    }


def refuse_unknown(given: Iterable[str], known: Iterable[str], where: str) -> None:
    """Raise InputError for the first key that is not known, naming the nearest that is."""
    names = list(known)
    for key in given:
        if key not in names:
            near = difflib.get_close_matches(key, names, n=1, cutoff=0.5)
            fix = f"did you mean '{near[0]}'?" if near else f"known keys: {', '.join(names)}"
            raise InputError(f"{where}: unknown key '{key}'; {fix}")


def _given(attribute: "Attribute[Any]", mapping: Mapping[str, Any], where: str) -> bool:
    key = key_of(attribute)
    if key not in mapping and attribute.default is NOTHING:
        raise InputError(f"{where}: key '{key}' is missing; add it")
    return key in mapping


def _field(attribute: "Attribute[Any]", kind: Any, given: Any, where: str) -> Any:
    scale = float(attribute.metadata.get("scale", 1.0))
    if kind is float and type(given) is int:  # a limit of 0 is out of range, with a point or not
        _refuse_out_of_range(attribute, scale * given, given, where)
    value = converted(kind, given, scale, where)
    _refuse_out_of_range(attribute, value, given, where)
    return value


def _refuse_out_of_range(attribute: "Attribute[Any]", value: Any, given: Any, where: str) -> None:
    if attribute.validator:
        try:
            attribute.validator(None, attribute, value)
        except (ValueError, TypeError) as error:
            raise InputError(f"{where} = {given} is out of range: {error.args[0]}") from error


def converted(kind: Any, given: Any, scale: float, where: str) -> Any:
    """Return a value of a type as a person gave it, times ``scale`` where it is a float.

    Raises InputError naming ``where`` and the fix where it is of another type, or not finite.
    """
    if get_origin(kind) is UnionType:
        kind = get_args(kind)[0]
    if get_origin(kind) is tuple:
        return _items(kind, given, scale, where)
    if has(kind):
        return from_mapping(kind, given, where)
    if kind not in _WORDS:
        return given
    if type(given) is not kind:
        raise InputError(f"{where} = {given!r} should be {_WORDS[kind]}")
    if kind is not float:
        return given
    if not math.isfinite(given):
        raise InputError(f"{where} = {given} is not finite; give a number")
    return _times(given, scale)


def _items(kind: Any, given: Any, scale: float, where: str) -> tuple[Any, ...]:
    if not isinstance(given, list):
        raise InputError(f"{where} = {given!r} should be a list, as [1.0, 2.0]")
    item, *rest = get_args(kind)
    if rest != [...] and len(given) != 1 + len(rest):
        raise InputError(f"{where} has {len(given)} entries, not {1 + len(rest)}")
    return tuple(converted(item, each, scale, f"{where}[{i}]") for i, each in enumerate(given))


def _plain(value: Any, scale: float) -> Any:
    if has(type(value)):
        return to_mapping(value)
    if isinstance(value, tuple):
        return [_plain(each, scale) for each in value]
    return _times(value, 1.0 / scale) if isinstance(value, float) else value


def _times(value: float, scale: float) -> float:
    """Return the product as a person would: 28.0 times 1e-6 is 28e-6, which is not so in binary."""
    return value if scale == 1.0 else float(f"{value * scale:.15g}")
