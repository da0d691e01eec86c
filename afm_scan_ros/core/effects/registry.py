"""All physical effects: those of the base model, and those that a scanner may have beyond it.

An effect is found by being registered in a module of this package. Nothing else lists it. The base
model's are described here, and not in their modules, because the chain imports these modules and a
description refers to the chain.
"""

from collections import defaultdict
from collections.abc import Iterable
from importlib import import_module
from pkgutil import walk_packages

import numpy as np
from attrs import evolve

from afm_scan_ros.core import effects
from afm_scan_ros.core.effects import creep as creep_module
from afm_scan_ros.core.effects import vibration as vibration_module
from afm_scan_ros.core.effects.effect_type import (
    REGISTERED,
    EffectParameter,
    EffectType,
    FeedbackForm,
    register,
)
from afm_scan_ros.core.effects.hysteresis import duhem, preisach
from afm_scan_ros.core.errors import InputError


def symmetric(declared: Iterable[EffectType]) -> tuple[EffectType, ...]:
    """Effects in alphabetical order, each confusable with all that either of the two declares."""
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


@register
def creep() -> EffectType:
    """Describe the effect."""
    return EffectType(
        name="creep",
        equation="x = x0 + sum of z_i, time_constants_i dz_i/dt + z_i = gains_i x0",
        needs="steps held as long as the slowest time constant that matters",
        experiment="creep",
        remedy="feedforward",
        advice="the inverse counts from the scan's start: rest as long before it as creep lasts",
        source="D. Croft, G. Shed and S. Devasia, J. Dyn. Syst. Meas. Control 123"
        " (2001) 35, Eqs. 1, 6 and 9.",
        inverse="Each step of the sampled system is solved for its input, so the inverse is exact.",
        parameters=(
            EffectParameter("gains", "1", -np.inf, np.inf),
            EffectParameter("time_constants", "s", 0.0, np.inf),
        ),
        physics=creep_module.__doc__ or "",
    )


@register
def hysteresis() -> EffectType:
    """Describe the effect."""
    return EffectType(
        name="hysteresis",
        equation="F = sum of plays of u, weighted by the Everett surface E(alpha, beta), or dF/du ="
        " rising(u, F) while u grows and falling(u, F) while it falls",
        needs="moves between many levels over the whole range of the drive",
        experiment="hysteresis",
        remedy="feedforward",
        advice="scan within the range that was identified",
        source="D. Croft, G. Shed and S. Devasia, J. Dyn. Syst. Meas. Control 123"
        " (2001) 35, Eqs. 11 to 17; B. D. Coleman and M. L. Hodgdon, Int. J. Engineering Science 24"
        " (1986) 897.",
        inverse="The exact inverse solves one cell of the surface, or one step of the differential"
        " equation, for each sample. The direct inverse is the paper's: a Preisach model identified"
        " from output to input.",
        parameters=(
            EffectParameter("lower", "V", -np.inf, np.inf),
            EffectParameter("upper", "V", -np.inf, np.inf),
            EffectParameter("offset", "V", -np.inf, np.inf),
            EffectParameter("values", "V", 0.0, np.inf),
        ),
        physics="\n".join((preisach.__doc__ or "", duhem.__doc__ or "")),
    )


@register
def vibration() -> EffectType:
    """Describe the effect."""
    return EffectType(
        name="vibration",
        equation="x = numerator(s) / denominator(s) exp(-s delay) F",
        needs="a drive with power at all frequencies up to some times the first resonance",
        experiment="frequency",
        remedy="feedforward",
        advice="the preview must be as long as the inverse's response to the targets ahead",
        source="D. Croft, G. Shed and S. Devasia, J. Dyn. Syst. Meas. Control 123"
        " (2001) 35, Eqs. 5, 8 and 22.",
        inverse="The optimal inverse of Eq. 22, as a filter that looks ahead by the preview. Its"
        " weight bounds the drive above the corner frequency.",
        parameters=(
            EffectParameter("numerator", "V/V", -np.inf, np.inf),
            EffectParameter("denominator", "1", -np.inf, np.inf),
            EffectParameter("delay", "s", 0.0, vibration_module.LONGEST_DELAY),
        ),
        physics=vibration_module.__doc__ or "",
    )


for _module in walk_packages(effects.__path__, f"{effects.__name__}."):
    import_module(_module.name)
EFFECTS = symmetric(REGISTERED.values())
COUPLED_EFFECTS = tuple(each for each in EFFECTS if each.feedback)
"""Effects that a coupled structure may have."""
FEEDBACK_EFFECTS = tuple(e for e in COUPLED_EFFECTS if e.feedback and not e.feedback.linear)
"""Those that add inputs to it, and are identified with it."""
CATALOGUE = tuple(each for each in EFFECTS if each.forms)
"""Effects beyond the base model, of one axis or two."""


def coupled_form(name: str, among: tuple[EffectType, ...] = COUPLED_EFFECTS) -> FeedbackForm:
    """Return what an effect does to a coupled structure; raises InputError where it does not."""
    form = effect_type(name, among).feedback
    assert form  # noqa: S101 - by which COUPLED_EFFECTS were chosen
    return form


def feedback_form(name: str) -> FeedbackForm:
    """Return how an effect of a name acts in feedback; raises InputError where there is none."""
    return coupled_form(name, FEEDBACK_EFFECTS)


def changes_linearly(name: str) -> bool:
    """Whether an effect changes a coupled structure's linear response, and no more."""
    return coupled_form(name).linear


def effect_type(name: str, among: tuple[EffectType, ...] = CATALOGUE) -> EffectType:
    """Return the effect of a name, beyond the base model; raises InputError for an unknown one."""
    for found in among:
        if found.name == name:
            return found
    names = ", ".join(each.name for each in among)
    raise InputError(f"no effect is named {name!r}: choose among {names}")
