"""Scores of fitted candidates: complexity penalty, significance and lack of fit.

A formula approximates the physics, so a share of what it explains in a band may remain there. This
allowance holds only in the bands where it explains something.
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
    """Misfit plus the reduction at which a parameter's interval excludes its neutral value."""
    return trial.misfit + CONFIDENT**2 * SYSTEMATIC * trial.fit.values.size


def score(trial: FittedCandidates) -> float:
    """Misfit of a trial plus the complexity penalties of its candidates."""
    return trial.misfit + sum(complexity_penalty(candidate) for candidate in trial.candidates)


def significant_amplitude(trial: FittedCandidates) -> bool:
    """Whether the interval of an amplitude of the last candidate excludes its neutral value."""
    last = trial.part(len(trial.candidates) - 1)
    neutral = np.array(trial.candidates[-1].form.neutral)
    away = np.abs(trial.fit.values[last] - neutral) > trial.fit.halfwidth[last]
    amplitudes = neutral == 0.0
    return bool(np.any(away[amplitudes] if amplitudes.any() else away))


def reduces_to_simpler(trial: FittedCandidates, owner: Candidate) -> bool:
    """Whether the last candidate, of more parameters than ``owner``, does no more than that one.

    True where a parameter is at an edge of its range, where no amplitude is significant, and where
    the interval holds the value at which the candidate becomes ``owner``.
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
    """Reduction of the misfit that an effect must reach."""
    parameters = len(candidate.form.parameters)
    return PENALTY_PER_EFFECT + PENALTY_PER_PARAMETER * (parameters + math.log(len(CANDIDATES)))


LACKING = 2.5
"""Ratio of a band's rms to its detection limit above which the model lacks something."""
EXPLAINED_SHARE, LARGEST_RATIO = 0.02, 30.0
"""Share of the power explained in a band that may remain there, a seventh in amplitude; and the
largest ratio to its detection limit that any band may keep."""


def reduction(before: Sequence[Array], after: Sequence[Array]) -> Array:
    """Reduction of the mean square in each band of each record, at least 0.

    ``before`` and ``after``, one array per record, are the residual's rms over the detection limit
    by band.
    """
    fell = np.concatenate(before) ** 2 - np.concatenate(after) ** 2
    return np.asarray(np.maximum(fell, 0.0))


def lack_of_fit(before: Sequence[Array], after: Sequence[Array]) -> bool:
    """Whether ``after`` exceeds what an adequate explanation leaves; arguments as above."""
    left = np.concatenate(after)
    within_formula_error = left**2 - 1.0 <= EXPLAINED_SHARE * reduction(before, after)
    return bool(np.any((left > LARGEST_RATIO) | ((left > LACKING) & ~within_formula_error)))
