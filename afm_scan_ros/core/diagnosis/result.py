"""What a diagnosis identified: values with intervals, effects with evidence, alternatives."""

import math
from collections.abc import Iterator
from enum import Enum
from operator import attrgetter

from attrs import evolve, frozen

from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.diagnosis.axis_diagnosis import AMBIGUOUS, UNEXPLAINED, AxisDiagnosis
from afm_scan_ros.core.diagnosis.candidates import Candidate, FittedCandidates
from afm_scan_ros.core.diagnosis.competing import EquivalentForm
from afm_scan_ros.core.diagnosis.evidence import misfit
from afm_scan_ros.core.effects.effect_type import EffectParameter
from afm_scan_ros.core.effects.registry import effect_type

EDGE, EDGE_OF_HALF = 1e-3, 1e-2
"""Distance from an end of the range within which a value is at this end: the larger of a share of
the end and a share of half the interval."""


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
        half = self.halfwidth if math.isfinite(self.halfwidth) else 0.0
        ends = self.parameter.lower, self.parameter.upper
        return any(abs(self.value - e) <= max(EDGE * abs(e), EDGE_OF_HALF * half) for e in ends)


class WhyNot(Enum):
    """Why an alternative is not the effect that was selected."""

    SAME_EFFECT = "another form of the same effect"
    SAME_PLACE = "fits as well in its place"
    MODEL_ERROR = "model discrepancy that repeats with the motion"
    UNTESTED = "model discrepancy, not known for such a motion"
    LARGER_MISFIT = "leaves a larger misfit"
    PARTIAL = "explains a part of the residual"


RUNNERS_UP = 3
MODEL_ERROR = "model_error"
"""Alternative that stands for the model's own error."""


@frozen
class EffectEvidence:
    """Evidence for an effect, on stretches that no fit saw; lengths in m, rms.

    Misfits are sums over ``bands`` bands, each 1 at the detection limit. ``competing`` are the
    effects that fit nearly as well in its place and ``runner_up`` the best of the others tried
    alone, with their misfits. ``other_form`` is the kind of the form that fits as well but moves
    the scanner most differently, and by how much. ``synchronous`` says that it repeats with the
    motion. ``largest_ratio`` is the largest remaining band over its detection limit.
    """

    rms_without: float
    rms_with: float
    misfit_without: float
    misfit_with: float
    bands: int
    competing: tuple[tuple[str, float], ...]
    runner_up: tuple[str, float] | None
    other_form: tuple[str, float] | None
    synchronous: bool
    largest_ratio: float


@frozen(eq=False)
class IdentifiedEffect:
    """An effect of the catalogue on one axis, with its evidence.

    ``explained_fraction`` is the share of the residual's mean square that returns where this effect
    alone is left out, the others at the values of the joint fit. Those of several effects need not
    sum to one. ``equivalent`` are the other kinds of it that fit as well.
    """

    name: str
    kind: str
    equivalent: tuple[str, ...]
    axis: str
    values: tuple[Value, ...]
    explained_fraction: float
    evidence: EffectEvidence


@frozen(eq=False)
class Alternative:
    """An effect that was tried; ``score`` is its misfit in detection limits squared.

    A disturbance synchronous with the drive may be the model's own error, and any effect where
    that error is not known; the score is then the misfit without the effect. ``selected`` are the
    names of the effects in the model, ``selected_misfit`` is their misfit, and ``selected_kind``
    the form of the one in question.
    """

    name: str
    kind: str
    axis: str
    score: float
    why_not: WhyNot
    selected: tuple[str, ...]
    selected_kind: str
    selected_misfit: float

    @property
    def kind_label(self) -> str:
        """Label of its form among the forms of its effect."""
        return "" if self.name == MODEL_ERROR else effect_type(self.name).kind_label(self.kind)


def effects(diagnosed: AxisDiagnosis) -> Iterator[IdentifiedEffect]:
    """Yield the effects of one axis; none where its residual is unexplained."""
    selected, refit_on_all = diagnosed.selection.selected, diagnosed.refit_on_all
    if selected is None or refit_on_all is None or diagnosed.verdict == UNEXPLAINED:
        return
    for place, candidate in enumerate(selected.candidates):
        without = selected.without(diagnosed.chain, place)
        yield IdentifiedEffect(
            name=candidate.effect.name,
            kind=candidate.form.kind,
            equivalent=tuple(
                each.competing.candidate.form.kind for each in _equivalent(diagnosed, place)
            ),
            axis=diagnosed.axis,
            values=_values(refit_on_all, place),
            explained_fraction=_own_share(diagnosed, without),
            evidence=_evidence(diagnosed, selected, place, without),
        )


def alternatives(diagnosed: AxisDiagnosis) -> Iterator[Alternative]:
    """Yield the competing models of an ambiguous axis, else the runners-up."""
    selection, selected = diagnosed.selection, diagnosed.selection.selected
    if selected is None:
        return
    if diagnosed.verdict == AMBIGUOUS:
        for competing in selection.competing_models:
            own = selected.candidates[competing.place]
            same = competing.candidate.effect.name == own.effect.name
            why = WhyNot.SAME_EFFECT if same else WhyNot.SAME_PLACE
            found = _alternative(diagnosed, competing.candidate, competing.trial, why)
            yield evolve(found, selected=(own.effect.name,), selected_kind=own.form.kind)
        yield from _model_errors(diagnosed, selected)
        return
    why = WhyNot.PARTIAL if diagnosed.verdict == UNEXPLAINED else WhyNot.LARGER_MISFIT
    for trial in selection.first[: RUNNERS_UP + 1]:
        if diagnosed.verdict == UNEXPLAINED or trial.names[0] not in selected.names:
            yield _alternative(diagnosed, trial.candidates[0], trial, why)


def _alternative(
    diagnosed: AxisDiagnosis, candidate: Candidate, trial: FittedCandidates, why: WhyNot
) -> Alternative:
    selected = diagnosed.selection.selected
    names, left = (
        (selected.names, selected.misfit) if selected else ((), diagnosed.selection.misfit_before)
    )
    name, kind = candidate.effect.name, candidate.form.kind
    return Alternative(name, kind, diagnosed.axis, trial.misfit, why, tuple(names), "", left)


def _model_errors(diagnosed: AxisDiagnosis, selected: FittedCandidates) -> Iterator[Alternative]:
    """Yield the model's own error in the place of a disturbance, or of any effect if unknown."""
    why = WhyNot.UNTESTED if diagnosed.untested else WhyNot.MODEL_ERROR
    every = range(len(selected.candidates))
    for place in every if diagnosed.untested else diagnosed.synchronous_places:
        left = misfit(diagnosed.evidence, selected.without(diagnosed.chain, place), fitted=False)
        owner = (selected.names[place],)
        yield Alternative(MODEL_ERROR, "", diagnosed.axis, left, why, owner, "", selected.misfit)


def _own_share(diagnosed: AxisDiagnosis, without: Chain) -> float:
    """Share of the mean square before that returns without one effect."""
    before, lacking, after = (
        diagnosed.rms(chain) ** 2 for chain in (diagnosed.chain, without, diagnosed.extended)
    )
    return (lacking - after) / before


def _values(refit_on_all: FittedCandidates, place: int) -> tuple[Value, ...]:
    part, parameters = refit_on_all.part(place), refit_on_all.candidates[place].form.parameters
    numbers = zip(
        parameters, refit_on_all.fit.values[part], refit_on_all.fit.halfwidth[part], strict=True
    )
    return tuple(Value(parameter, float(v), float(half)) for parameter, v, half in numbers)


def _evidence(
    diagnosed: AxisDiagnosis, selected: FittedCandidates, place: int, without: Chain
) -> EffectEvidence:
    most = max(_equivalent(diagnosed, place), key=attrgetter("rms"), default=None)
    competing, runner_up = _others(diagnosed, selected, place)
    return EffectEvidence(
        rms_without=diagnosed.rms(without),
        rms_with=diagnosed.rms(diagnosed.extended),
        misfit_without=misfit(diagnosed.evidence, without, fitted=False),
        misfit_with=diagnosed.selection.misfit_after,
        bands=sum(len(each.limit.rms) for each in diagnosed.evidence),
        competing=competing,
        runner_up=runner_up,
        other_form=(most.competing.candidate.form.kind, most.rms) if most else None,
        synchronous=place in diagnosed.synchronous_places,
        largest_ratio=max(float(ratio.max()) for ratio in diagnosed.ratio_after),
    )


def _equivalent(diagnosed: AxisDiagnosis, place: int) -> list[EquivalentForm]:
    return [each for each in diagnosed.selection.equivalent if each.competing.place == place]


def _others(
    diagnosed: AxisDiagnosis, selected: FittedCandidates, place: int
) -> tuple[tuple[tuple[str, float], ...], tuple[str, float] | None]:
    """Return the competing effects in its place, and the best of the other single candidates."""
    owner, selection = selected.names[place], diagnosed.selection
    here = [
        r
        for r in selection.competing_models
        if r.place == place and r.candidate.effect.name != owner
    ]
    competing = tuple((r.candidate.effect.name, r.trial.misfit) for r in here)
    others = [trial for trial in selection.first if trial.names[0] != owner]
    if not others or here or len(selected.candidates) > 1:
        return competing, None
    return competing, (others[0].names[0], others[0].misfit)
