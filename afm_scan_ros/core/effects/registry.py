"""All physical effects: those of the base model, and those that a scanner may have beyond it.

An effect is found by being registered in a module of this package. Nothing else lists it.
"""

from collections import defaultdict
from collections.abc import Iterable
from importlib import import_module
from pkgutil import walk_packages

from attrs import evolve

from afm_scan_ros.core import effects
from afm_scan_ros.core.effects.effect_type import REGISTERED, EffectType, FeedbackForm
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
COUPLED_EFFECTS = tuple(each for each in EFFECTS if each.feedback)
"""Effects that a coupled structure may have."""
FEEDBACK_EFFECTS = tuple(e for e in COUPLED_EFFECTS if e.feedback and not e.feedback.linear)
"""Those that add inputs to it, and are identified with it."""
CATALOGUE = tuple(each for each in EFFECTS if each.forms)
"""Effects beyond the base model, of one axis or two."""


def effect_type(name: str) -> EffectType:
    """Return the effect of a name beyond the base model; raises InputError where there is none."""
    return _named(name, CATALOGUE)


def feedback_form(name: str) -> FeedbackForm:
    """Return how an effect of a name acts in feedback; raises InputError where there is none."""
    return coupled_form(_named(name, FEEDBACK_EFFECTS).name)


def coupled_form(name: str) -> FeedbackForm:
    """Return what an effect does to a coupled structure; raises InputError where it does not."""
    form = _named(name, COUPLED_EFFECTS).feedback
    assert form  # noqa: S101 - by which COUPLED_EFFECTS were chosen
    return form


def changes_linearly(name: str) -> bool:
    """Whether an effect changes a coupled structure's linear response, and no more."""
    return coupled_form(name).linear


def _named(name: str, among: tuple[EffectType, ...]) -> EffectType:
    for found in among:
        if found.name == name:
            return found
    names = ", ".join(each.name for each in among)
    raise InputError(f"no effect is named {name!r}: choose among {names}")
