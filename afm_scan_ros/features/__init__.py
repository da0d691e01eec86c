"""Features: each folder here holds all of one subject, and states what it adds to the kernel.

A feature is a package that may state ``COMMANDS``, what each of its commands does, ``DRIVERS``, the
class of each of its drivers by short name, ``ONLINE``, the place of each ``OnlineOption`` of a
scan, and ``VIEWS``, that of each ``ScanView`` beside one. The command NAME stands in
``NAME_command`` of the package. The kernel knows features by this registry alone, and no feature
imports another.
"""

import pkgutil
from collections.abc import Mapping
from functools import cache
from importlib import import_module
from types import ModuleType
from typing import Any


@cache
def _features() -> tuple[ModuleType, ...]:
    names = sorted(module.name for module in pkgutil.iter_modules(__path__))
    return tuple(import_module(f"{__name__}.{name}") for name in names)


def commands() -> Mapping[str, str]:
    """Return what each command of a feature does, by its name."""
    return _joined("COMMANDS")


def drivers() -> Mapping[str, str]:
    """Return the class of each driver of a feature, as ``module:Class``, by its short name."""
    return _joined("DRIVERS")


def options() -> Mapping[str, Any]:
    """Return what features do while a scan runs, an ``OnlineOption`` each, by its name."""
    return {name: pkgutil.resolve_name(place) for name, place in _joined("ONLINE").items()}


def views() -> Mapping[str, Any]:
    """Return the viewers that features open beside a scan, a ``ScanView`` each, by its name."""
    return {name: pkgutil.resolve_name(place) for name, place in _joined("VIEWS").items()}


def module_of(command: str) -> str:
    """Return the module of a feature's command."""
    owner = next(each for each in _features() if command in getattr(each, "COMMANDS", {}))
    return f"{owner.__name__}.{command}_command"


def _joined(name: str) -> Mapping[str, str]:
    return {key: said for each in _features() for key, said in getattr(each, name, {}).items()}
