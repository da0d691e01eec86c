"""What a trial is worth: its price, and whether its last effect is certain, or one at all.

What is left beside what is explained: a formula is not quite the physics, but near it.

It is near in the bands in which it explains, and no excuse for what is left in others: what a
drift's formula leaves is slow, and not at the line rate.
"""

import math
from collections.abc import Sequence

import numpy as np

from afm_scan_ros.core.diagnosis.candidates import CANDIDATES, Candidate, FittedCandidates
from afm_scan_ros.core.diagnosis.fit import CONFIDENT, SYSTEMATIC
from afm_scan_ros.core.effects.effect_type import EffectForm
from afm_scan_ros.core.types import Array

PENALTY_PER_EFFECT, PENALTY_PER_PARAMETER = 2.0, 0.25
EDGE = 1e-3
"""Share of a parameter's range that counts as its edge."""
ENDS = ("lower", "upper")


def undetermined_misfit(trial: FittedCandidates) -> float:
    """Misfit, and what a parameter must lower it by lest its interval hold that of no effect."""
    return trial.misfit + CONFIDENT**2 * SYSTEMATIC * trial.fit.values.size


def score(trial: FittedCandidates) -> float:
    """What a trial's misfit comes to with the price of its candidates."""
    return trial.misfit + sum(complexity_penalty(candidate) for candidate in trial.candidates)


def significant_amplitude(trial: FittedCandidates) -> bool:
    """Whether the interval of an amplitude of the last candidate leaves out that of no effect."""
    last = trial.part(len(trial.candidates) - 1)
    neutral = np.array(trial.candidates[-1].form.neutral)
    away = np.abs(trial.fit.values[last] - neutral) > trial.fit.halfwidth[last]
    amplitudes = neutral == 0.0
    return bool(np.any(away[amplitudes] if amplitudes.any() else away))


def reduces_to_simpler(trial: FittedCandidates, owner: Candidate) -> bool:
    """Whether the last candidate, of more parameters, is a simpler one in disguise.

    So it is where a parameter is at an edge, where the record leaves open whether there is any of
    it, and where it leaves open what makes it more than the simpler one.
    """
    form = trial.candidates[-1].form
    if len(form.parameters) <= len(owner.form.parameters):
        return False
    becomes_it = form.becomes == (owner.effect.name, owner.form.kind)
    last = trial.part(len(trial.candidates) - 1)
    open_end = becomes_it and _reaches_edge(form, trial.fit.values[last], trial.fit.halfwidth[last])
    return (
        open_end or _reaches_edge(form, trial.fit.values[last]) or not significant_amplitude(trial)
    )


def _reaches_edge(form: EffectForm, values: Array, halfwidth: Array | float = 0.0) -> bool:
    """Whether a value, or its interval, reaches the edge of a parameter's range."""
    lower, upper = (np.array([getattr(p, end) for p in form.parameters]) for end in ENDS)
    room = EDGE * (upper - lower)
    return bool(np.any((values - halfwidth < lower + room) | (values + halfwidth > upper - room)))


def complexity_penalty(candidate: Candidate) -> float:
    """What an effect must lower the misfit by."""
    parameters = len(candidate.form.parameters)
    return PENALTY_PER_EFFECT + PENALTY_PER_PARAMETER * (parameters + math.log(len(CANDIDATES)))


LACKING = 2.5
"""A band's rms over its floor, from which on something is missing in the model."""
EXPLAINED_SHARE, LARGEST_RATIO = 0.02, 30.0
"""Share of what is explained in a band that may be left over there, a seventh in amplitude; but no
band may be left so many times its floor."""


def reduction(before: Sequence[Array], after: Sequence[Array]) -> Array:
    """By how much the mean square fell in each band of each record, where it did.

    ``before`` and ``after``, one array a record, are the residual's rms over the floor by band.
    """
    fell = np.concatenate(before) ** 2 - np.concatenate(after) ** 2
    return np.asarray(np.maximum(fell, 0.0))


def lack_of_fit(before: Sequence[Array], after: Sequence[Array]) -> bool:
    """Whether more is left ``after`` an explanation than where it is one; both as above."""
    left = np.concatenate(after)
    within_formula_error = left**2 - 1.0 <= EXPLAINED_SHARE * reduction(before, after)
    return bool(np.any((left > LARGEST_RATIO) | ((left > LACKING) & ~within_formula_error)))
