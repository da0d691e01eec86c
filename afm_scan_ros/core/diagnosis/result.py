"""What a parameter came to, and whether the catalogue's range or the records tell it.

What is said of a traced effect, and of those that might stand for it.
"""

import math
from collections.abc import Iterator
from operator import attrgetter

from attrs import frozen

from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.diagnosis.axis_diagnosis import AMBIGUOUS, FOUND, UNEXPLAINED, AxisDiagnosis
from afm_scan_ros.core.diagnosis.candidates import Candidate, FittedCandidates
from afm_scan_ros.core.diagnosis.competing import CompetingModel, EquivalentForm
from afm_scan_ros.core.diagnosis.evidence import misfit
from afm_scan_ros.core.effects.entry import Parameter
from afm_scan_ros.core.effects.registry import entry
from afm_scan_ros.core.numerals import significant

EDGE, EDGE_OF_HALF = 1e-3, 1e-2
"""Shares of an end of the range and of half the interval: a value so near to that end is at it."""


@frozen(eq=False)
class Value:
    """A parameter's value in its unit, with its 95 % interval."""

    parameter: Parameter
    value: float
    halfwidth: float

    @property
    def interval(self) -> tuple[float, float]:
        """Ends of the interval, as far as the catalogue allows them."""
        ends = self.value - self.halfwidth, self.value + self.halfwidth
        low, high = map(self.parameter.nearest, ends)
        return low, high

    @property
    def cut(self) -> bool:
        """Whether the interval goes beyond what the catalogue allows."""
        low, high = self.interval
        return math.isfinite(self.halfwidth) and high - low < 2.0 * self.halfwidth * (1.0 - 1e-9)

    @property
    def at_edge(self) -> bool:
        """Whether the value is all that the catalogue allows, so that the records leave it open."""
        half = self.halfwidth if math.isfinite(self.halfwidth) else 0.0
        ends = self.parameter.lower, self.parameter.upper
        return any(abs(self.value - e) <= max(EDGE * abs(e), EDGE_OF_HALF * half) for e in ends)


RUNNERS_UP = 3
MODEL_ERROR = "model_error"
"""Stands among the alternatives for what the model leaves of the motion itself."""


@frozen(eq=False)
class IdentifiedEffect:
    """An effect of the catalogue on one axis, with the evidence in sentences.

    ``explained_fraction`` is its own: the share of the residual's mean square that comes back where
    it alone is left out, the others as they were fitted beside it. Those of several need not sum to
    one. ``equivalent`` are the other kinds of it that would do as well.
    """

    name: str
    kind: str
    equivalent: tuple[str, ...]
    axis: str
    values: tuple[Value, ...]
    explained_fraction: float
    evidence: tuple[str, ...]


@frozen(eq=False)
class Alternative:
    """An effect that was tried; ``score`` is the misfit that it leaves (floors squared).

    One in step with the drive may be the model's own error, for which nothing is added: its score
    is the misfit without the effect.
    """

    name: str
    kind: str
    axis: str
    score: float
    why_not: str

    @property
    def kind_words(self) -> str:
        """What tells its form from others of its effect."""
        return "" if self.name == MODEL_ERROR else entry(self.name).kind_words(self.kind)


def effects(trace: AxisDiagnosis) -> Iterator[IdentifiedEffect]:
    """Effects kept on one axis; none where its residual stays unexplained."""
    selected, refit_on_all = trace.selection.selected, trace.refit_on_all
    if selected is None or refit_on_all is None or trace.verdict == UNEXPLAINED:
        return
    for place, candidate in enumerate(selected.candidates):
        without = selected.without(trace.chain, place)
        yield IdentifiedEffect(
            name=candidate.entry.name,
            kind=candidate.form.kind,
            equivalent=tuple(
                each.competing.candidate.form.kind for each in _equivalent(trace, place)
            ),
            axis=trace.axis,
            values=_values(refit_on_all, place),
            explained_fraction=_own_share(trace, without),
            evidence=tuple(_evidence(trace, selected, place, without)),
        )


def alternatives(trace: AxisDiagnosis) -> Iterator[Alternative]:
    """Rivals where the axis is ambiguous; else the runners-up, and why they are not it."""
    selection, selected = trace.selection, trace.selection.selected
    if selected is None:
        return
    if trace.verdict == AMBIGUOUS:
        for competing in selection.competing_models:
            yield _alternative(
                trace, competing.candidate, competing.trial, _why_competing(competing, selected)
            )
        yield from (_model_error(trace, selected, place) for place in trace.synchronous_places)
        return
    why = {
        FOUND: _why_worse(selected),
        UNEXPLAINED: "explains a part of the residual, and leaves what no effect would leave",
    }
    for trial in selection.first[: RUNNERS_UP + 1]:
        if trace.verdict == UNEXPLAINED or trial.names[0] not in selected.names:
            yield _alternative(trace, trial.candidates[0], trial, why[trace.verdict])


def _alternative(
    trace: AxisDiagnosis, candidate: Candidate, trial: FittedCandidates, why: str
) -> Alternative:
    return Alternative(candidate.entry.name, candidate.form.kind, trace.axis, trial.misfit, why)


def _model_error(trace: AxisDiagnosis, selected: FittedCandidates, place: int) -> Alternative:
    """What the model leaves of a motion that repeats, in the place of a disturbance."""
    left = misfit(trace.evidence, selected.without(trace.chain, place), fitted=False)
    why = (
        "what the model leaves of the motion itself is in step with the drive too, and cannot be"
        f" told from {selected.names[place]}; the score is that of nothing in its place"
    )
    return Alternative(MODEL_ERROR, "", trace.axis, left, why)


def _why_competing(competing: CompetingModel, selected: FittedCandidates) -> str:
    owner = selected.names[competing.place]
    if competing.candidate.entry.name == owner:
        other, own = _form_texts(competing, selected)
        return f"as '{other}', cannot be told from '{own}'"
    return f"in its place, cannot be told from {owner}"


def _why_worse(selected: FittedCandidates) -> str:
    alone, together = ("alone, ", " together") if len(selected.candidates) > 1 else ("", "")
    return (
        f"{alone}leaves more than the {significant(selected.misfit)} of "
        f"{' and '.join(selected.names)}"
        f"{together}, on stretches that it did not see"
    )


def _own_share(trace: AxisDiagnosis, without: Chain) -> float:
    """Share of the mean square before that is there again without one effect."""
    before, lacking, after = (
        trace.rms(chain) ** 2 for chain in (trace.chain, without, trace.extended)
    )
    return (lacking - after) / before


def _values(refit_on_all: FittedCandidates, place: int) -> tuple[Value, ...]:
    part, parameters = refit_on_all.part(place), refit_on_all.candidates[place].form.parameters
    numbers = zip(
        parameters, refit_on_all.fit.values[part], refit_on_all.fit.halfwidth[part], strict=True
    )
    return tuple(Value(parameter, float(v), float(half)) for parameter, v, half in numbers)


def _evidence(
    trace: AxisDiagnosis, selected: FittedCandidates, place: int, without: Chain
) -> Iterator[str]:
    selection = trace.selection
    lacking, after = (significant(1e9 * trace.rms(c)) for c in (without, trace.extended))
    risen = misfit(trace.evidence, without, fitted=False)
    bands = sum(len(each.floor.rms) for each in trace.evidence)
    yield (
        f"on stretches that no fit saw, the residual in {trace.axis} is {lacking} nm rms without it"
        f" and {after} nm with it; its misfit, a sum over {bands} bands that is {bands} at the"
        f" floor, {significant(risen)} without and {significant(selection.misfit_after)} with it"
    )
    yield from _others(trace, selected, place)
    if like := _equivalent(trace, place):
        most = max(like, key=attrgetter("rms"))
        other, own = _form_texts(most.competing, selected)
        yield (
            f"as '{other}' it would do as well; the scanner would move"
            f" {significant(1e9 * most.rms, 2)} nm rms otherwise, and the intervals hold if it is"
            f" '{own}'"
        )
    for value in _values(trace.refit_on_all or selected, place):
        if value.at_edge:
            yield (
                f"its {value.parameter.name.replace('_', ' ')} is at the edge of what the catalogue"
                " allows, so these records leave it open"
            )
    if place in trace.synchronous_places:
        yield "it is in step with the drive: it may be what the model leaves of the motion itself"
    largest = max(float(ratio.max()) for ratio in trace.ratio_after)
    yield f"the largest band of what is left is {significant(largest, 2)} times its floor"


def _equivalent(trace: AxisDiagnosis, place: int) -> list[EquivalentForm]:
    return [each for each in trace.selection.equivalent if each.competing.place == place]


def _form_texts(competing: CompetingModel, selected: FittedCandidates) -> tuple[str, str]:
    """Return what another form of an effect is called, and the one that was kept."""
    forms = competing.candidate, selected.candidates[competing.place]
    other, own = (each.entry.kind_words(each.form.kind) for each in forms)
    return other, own


def _others(trace: AxisDiagnosis, selected: FittedCandidates, place: int) -> Iterator[str]:
    """Say what else was tried in its place; beside others only what does as well is known."""
    owner, selection = selected.names[place], trace.selection
    here = [
        r
        for r in selection.competing_models
        if r.place == place and r.candidate.entry.name != owner
    ]
    if here:
        left = (f"{r.candidate.entry.name} {significant(r.trial.misfit)}" for r in here)
        yield f"in its place do nearly as well, by the misfit that they leave: {', '.join(left)}"
    others = [trial for trial in selection.first if trial.names[0] != owner]
    if others and not here and len(selected.candidates) == 1:
        best = others[0]
        yield (
            f"of the others, each tried alone, {best.names[0]} does best for its price and leaves a"
            f" misfit of {significant(best.misfit)}"
        )
