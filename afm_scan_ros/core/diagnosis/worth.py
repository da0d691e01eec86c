"""What a trial is worth: its price, and whether its last effect is certain, or one at all."""

import math

import numpy as np

from afm_scan_ros.core.diagnosis.fit import CONFIDENT, SYSTEMATIC
from afm_scan_ros.core.diagnosis.trial import CANDIDATES, Candidate, Trial
from afm_scan_ros.core.effects.effect_type import EffectForm
from afm_scan_ros.core.types import Array

PRICE_OF_ONE, PRICE_OF_PARAMETER = 2.0, 0.25
EDGE = 1e-3
"""Share of a parameter's range that counts as its edge."""
ENDS = ("lower", "upper")


def untold(trial: Trial) -> float:
    """Misfit, and what a parameter must lower it by lest its interval hold that of no effect."""
    return trial.misfit + CONFIDENT**2 * SYSTEMATIC * trial.fit.values.size


def cost(trial: Trial) -> float:
    """What a trial's misfit comes to with the price of its candidates."""
    return trial.misfit + sum(price(candidate) for candidate in trial.candidates)


def certain(trial: Trial) -> bool:
    """Whether the interval of an amplitude of the last candidate leaves out that of no effect."""
    last = trial.part(len(trial.candidates) - 1)
    neutral = np.array(trial.candidates[-1].form.neutral)
    away = np.abs(trial.fit.values[last] - neutral) > trial.fit.halfwidth[last]
    amplitudes = neutral == 0.0
    return bool(np.any(away[amplitudes] if amplitudes.any() else away))


def imitates(trial: Trial, owner: Candidate) -> bool:
    """Whether the last candidate, of more parameters, is a simpler one in disguise.

    So it is where a parameter is at an edge, where the record leaves open whether there is any of
    it, and where it leaves open what makes it more than the simpler one.
    """
    form = trial.candidates[-1].form
    if len(form.parameters) <= len(owner.form.parameters):
        return False
    becomes_it = form.becomes == (owner.entry.name, owner.form.kind)
    last = trial.part(len(trial.candidates) - 1)
    open_end = becomes_it and _reaches_edge(form, trial.fit.values[last], trial.fit.halfwidth[last])
    return open_end or _reaches_edge(form, trial.fit.values[last]) or not certain(trial)


def _reaches_edge(form: EffectForm, values: Array, halfwidth: Array | float = 0.0) -> bool:
    """Whether a value, or its interval, reaches the edge of a parameter's range."""
    lower, upper = (np.array([getattr(p, end) for p in form.parameters]) for end in ENDS)
    room = EDGE * (upper - lower)
    return bool(np.any((values - halfwidth < lower + room) | (values + halfwidth > upper - room)))


def price(candidate: Candidate) -> float:
    """What an effect must lower the misfit by."""
    parameters = len(candidate.form.parameters)
    return PRICE_OF_ONE + PRICE_OF_PARAMETER * (parameters + math.log(len(CANDIDATES)))
