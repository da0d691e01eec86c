"""What a diagnosis identified: values with intervals, effects with evidence, alternatives."""

import math
from collections.abc import Iterator
from enum import Enum

from attrs import frozen

from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.diagnosis.axis_diagnosis import AMBIGUOUS, FOUND, AxisDiagnosis
from afm_scan_ros.core.diagnosis.candidates import FittedCandidates
from afm_scan_ros.core.diagnosis.likelihood import Likelihood
from afm_scan_ros.core.diagnosis.search import OUTSIDE, Names
from afm_scan_ros.core.diagnosis.settings import SEARCH
from afm_scan_ros.core.effects.effect_type import EffectParameter
from afm_scan_ros.core.effects.registry import effect_type


@frozen(eq=False)
class Value:
    """A parameter's value in its unit, with its 95 % interval."""

    parameter: EffectParameter
    value: float
    halfwidth: float

    @property
    def interval(self) -> tuple[float, float]:
        """Ends of the interval, within the range of the parameter."""
        ends = self.value - self.halfwidth, self.value + self.halfwidth
        low, high = map(self.parameter.nearest, ends)
        return low, high

    @property
    def cut(self) -> bool:
        """Whether the interval exceeds the range of the parameter."""
        low, high = self.interval
        return math.isfinite(self.halfwidth) and high - low < 2.0 * self.halfwidth * (1.0 - 1e-9)

    @property
    def at_edge(self) -> bool:
        """Whether the value is at an end of its range, so that the records do not determine it."""
        return self.parameter.at_end(self.value, self.halfwidth)


class WhyNot(Enum):
    """Why an alternative is not what was selected."""

    CREDIBLE = "within the credible set"
    MODEL_ERROR = "model discrepancy that repeats with the motion"
    UNTESTED = "model discrepancy, not known for such a motion"
    LESS_PROBABLE = "less probable"
    INADEQUATE = "explains a part of the residual"
    UNSETTLED = "its simulation diverges"


MODEL_ERROR, NONE = "model_error", "none"
"""Alternatives that stand for the model's own error, and for the model without an effect."""
RUNNERS_UP = 4
"""Alternatives stated, at most."""


@frozen
class EffectEvidence:
    """Evidence for an effect; lengths in m, rms on the held-out stretches.

    ``nats`` is the log likelihood with it minus that without it, the others at their values.
    ``synchronous`` says that it repeats with the motion. ``largest_ratio`` is the largest remaining
    band over its detection limit.
    """

    rms_without: float
    rms_with: float
    nats: float
    synchronous: bool
    largest_ratio: float


@frozen(eq=False)
class IdentifiedEffect:
    """An effect of the catalogue on one axis, with its ``probability`` and its evidence.

    ``explained_fraction`` is the share of the residual's mean square that returns where this effect
    alone is left out, the others at the values of the joint fit. Those of several effects need not
    sum to one. ``kinds`` are the probabilities of its forms, given the selected effects.
    """

    name: str
    kind: str
    kinds: tuple[tuple[str, float], ...]
    axis: str
    values: tuple[Value, ...]
    probability: float
    explained_fraction: float
    evidence: EffectEvidence

    @property
    def periodic(self) -> bool:
        """Whether it is one of spectral lines, with an amplitude and a phase for each."""
        return any(value.parameter.located for value in self.values)

    @property
    def equivalent(self) -> tuple[str, ...]:
        """Other forms that the records do not exclude."""
        return tuple(k for k, p in self.kinds if k != self.kind and p >= 1.0 - SEARCH.certain)


@frozen(eq=False)
class Alternative:
    """A set of effects that was tried, of a ``probability``; ``name`` joins theirs by " + ".

    ``score`` is the log of its posterior over that of the selected set, in nats. ``selected`` are
    the names of the effects in the model.
    """

    name: str
    kind: str
    axis: str
    score: float
    probability: float
    why_not: WhyNot
    selected: tuple[str, ...]

    @property
    def kind_label(self) -> str:
        """Label of its form among the forms of its effect."""
        one = self.name not in (MODEL_ERROR, NONE, *OUTSIDE) and " + " not in self.name
        return effect_type(self.name).kind_label(self.kind) if one else ""


def joined(names: Names) -> str:
    """Name of a set of effects in ``diagnosis.json``."""
    return " + ".join(names) or NONE


def effects(diagnosed: AxisDiagnosis) -> Iterator[IdentifiedEffect]:
    """Yield the effects of one axis; none unless the model lacks one that is stated."""
    selected, posterior = diagnosed.selection.selected, diagnosed.selection.posterior
    if selected is None or diagnosed.verdict not in (FOUND, AMBIGUOUS):
        return
    for place, candidate in enumerate(selected.candidates):
        without = selected.without(diagnosed.chain, place)
        yield IdentifiedEffect(
            name=candidate.effect.name,
            kind=candidate.form.kind,
            kinds=posterior.kinds(candidate.effect.name),
            axis=diagnosed.axis,
            values=_values(selected, place),
            probability=posterior.of_effect(candidate.effect.name),
            explained_fraction=_own_share(diagnosed, without),
            evidence=_evidence(diagnosed, place, without),
        )


def alternatives(diagnosed: AxisDiagnosis) -> Iterator[Alternative]:
    """Yield the other sets by their probability, the model's own error where it may be."""
    selection = diagnosed.selection
    posterior, stated = selection.posterior, diagnosed.final is not diagnosed.chain
    own = posterior.likeliest if stated else ()
    if stated and (diagnosed.like_own_error or diagnosed.synchronous_places):
        why = WhyNot.UNTESTED if diagnosed.like_own_error else WhyNot.MODEL_ERROR
        yield Alternative(MODEL_ERROR, "", diagnosed.axis, 0.0, math.nan, why, own)
    credible = posterior.credible(SEARCH.certain)
    for names in [n for n in posterior.probability if n != own][:RUNNERS_UP]:
        why = WhyNot.CREDIBLE if names in credible else WhyNot.LESS_PROBABLE
        best = posterior.best.get(names)
        cells = (best or selection.without).cells
        yield Alternative(
            name=joined(names),
            kind=best.candidates[0].form.kind if best and len(names) == 1 else "",
            axis=diagnosed.axis,
            score=posterior.log_odds(names, own),
            probability=posterior.probability[names],
            why_not=why if cells.adequate else WhyNot.INADEQUATE,
            selected=own,
        )


def _own_share(diagnosed: AxisDiagnosis, without: Chain) -> float:
    """Share of the mean square before that returns without one effect."""
    before, lacking, after = (
        diagnosed.rms(chain) ** 2 for chain in (diagnosed.chain, without, diagnosed.extended)
    )
    return (lacking - after) / before


def _values(selected: FittedCandidates, place: int) -> tuple[Value, ...]:
    part, parameters = selected.part(place), selected.candidates[place].form.parameters
    numbers = zip(parameters, selected.fit.values[part], selected.fit.halfwidth[part], strict=True)
    return tuple(Value(parameter, float(v), float(half)) for parameter, v, half in numbers)


def _evidence(diagnosed: AxisDiagnosis, place: int, without: Chain) -> EffectEvidence:
    lacking = Likelihood(diagnosed.evidence, diagnosed.chain).fit(without).log_likelihood
    return EffectEvidence(
        rms_without=diagnosed.rms(without),
        rms_with=diagnosed.rms_after,
        nats=diagnosed.selection.reached.log_likelihood - lacking,
        synchronous=place in diagnosed.synchronous_places,
        largest_ratio=max(float(ratio.max()) for ratio in diagnosed.ratio_after),
    )
