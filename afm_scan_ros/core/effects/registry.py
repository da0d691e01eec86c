"""All physical effects: those of the base model, and those that a scanner may have beyond it.

An effect is found by being registered in a module of this package. Nothing else lists it.
"""

from collections import defaultdict
from collections.abc import Iterable
from importlib import import_module
from pkgutil import walk_packages

from attrs import evolve

from afm_scan_ros.core import effects
from afm_scan_ros.core.effects.effect_type import REGISTERED, EffectType
from afm_scan_ros.core.errors import InputError


def symmetric(declared: Iterable[EffectType]) -> tuple[EffectType, ...]:
    """Effects in alphabetical order, each confusable with all that either of the two declares.

    Raises InputError where one is confusable with itself or with an effect that there is not.
    """
    known = {each.name: each for each in declared}
    confusable = defaultdict(set)
    for each in known.values():
        for other in each.confusable:
            if other == each.name or other not in known:
                raise InputError(
                    f"effect {each.name} is declared confusable with {other!r}: name another effect"
                )
            confusable[each.name].add(other)
            confusable[other].add(each.name)
    return tuple(
        evolve(known[name], confusable=tuple(sorted(confusable[name]))) for name in sorted(known)
    )


def _discovered() -> tuple[EffectType, ...]:
    for module in walk_packages(effects.__path__, f"{effects.__name__}."):
        import_module(module.name)
    return symmetric(REGISTERED.values())


EFFECTS = _discovered()
BASE_EFFECTS = tuple(each for each in EFFECTS if not each.forms)
CATALOGUE = tuple(each for each in EFFECTS if each.forms)
"""Effects beyond the base model."""


def effect_type(name: str) -> EffectType:
    """Return the effect of a name beyond the base model; raises InputError where there is none."""
    for found in CATALOGUE:
        if found.name == name:
            return found
    names = ", ".join(each.name for each in CATALOGUE)
    raise InputError(f"no effect is named {name!r}: choose among {names}")
