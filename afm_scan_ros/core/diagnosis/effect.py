"""What is said of a traced effect, and of those that might stand for it."""

from collections.abc import Iterator
from operator import attrgetter

from attrs import frozen

from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.diagnosis.axis_trace import AMBIGUOUS, FOUND, UNEXPLAINED, AxisTrace
from afm_scan_ros.core.diagnosis.evidence import misfit
from afm_scan_ros.core.diagnosis.forms import Alike
from afm_scan_ros.core.diagnosis.rivals import Rival
from afm_scan_ros.core.diagnosis.trial import Candidate, Trial
from afm_scan_ros.core.diagnosis.value import Value
from afm_scan_ros.core.effects.registry import effect_type
from afm_scan_ros.core.numerals import significant

RUNNERS_UP = 3
MODEL_ERROR = "model_error"
"""Stands among the alternatives for what the model leaves of the motion itself."""


@frozen(eq=False)
class TracedEffect:
    """An effect of the catalogue on one axis, with the evidence in sentences.

    ``explained_fraction`` is its own: the share of the residual's mean square that comes back where
    it alone is left out, the others as they were fitted beside it. Those of several need not sum to
    one. ``alike`` are the other kinds of it that would do as well.
    """

    name: str
    kind: str
    alike: tuple[str, ...]
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
        return "" if self.name == MODEL_ERROR else effect_type(self.name).kind_words(self.kind)


def effects(trace: AxisTrace) -> Iterator[TracedEffect]:
    """Effects kept on one axis; none where its residual stays unexplained."""
    kept, settled = trace.selection.kept, trace.settled
    if kept is None or settled is None or trace.verdict == UNEXPLAINED:
        return
    for place, candidate in enumerate(kept.candidates):
        without = kept.without(trace.chain, place)
        yield TracedEffect(
            name=candidate.entry.name,
            kind=candidate.form.kind,
            alike=tuple(each.rival.candidate.form.kind for each in _alike(trace, place)),
            axis=trace.axis,
            values=_values(settled, place),
            explained_fraction=_own_share(trace, without),
            evidence=tuple(_evidence(trace, kept, place, without)),
        )


def alternatives(trace: AxisTrace) -> Iterator[Alternative]:
    """Rivals where the axis is ambiguous; else the runners-up, and why they are not it."""
    selection, kept = trace.selection, trace.selection.kept
    if kept is None:
        return
    if trace.verdict == AMBIGUOUS:
        for rival in selection.rivals:
            yield _alternative(trace, rival.candidate, rival.trial, _untold(rival, kept))
        yield from (_model_error(trace, kept, place) for place in trace.in_step)
        return
    why = {
        FOUND: _left_more(kept),
        UNEXPLAINED: "explains a part of the residual, and leaves what no effect would leave",
    }
    for trial in selection.first[: RUNNERS_UP + 1]:
        if trace.verdict == UNEXPLAINED or trial.names[0] not in kept.names:
            yield _alternative(trace, trial.candidates[0], trial, why[trace.verdict])


def _alternative(trace: AxisTrace, candidate: Candidate, trial: Trial, why: str) -> Alternative:
    return Alternative(candidate.entry.name, candidate.form.kind, trace.axis, trial.misfit, why)


def _model_error(trace: AxisTrace, kept: Trial, place: int) -> Alternative:
    """What the model leaves of a motion that repeats, in the place of a disturbance."""
    left = misfit(trace.evidence, kept.without(trace.chain, place), taught=False)
    why = (
        "what the model leaves of the motion itself is in step with the drive too, and cannot be"
        f" told from {kept.names[place]}; the score is that of nothing in its place"
    )
    return Alternative(MODEL_ERROR, "", trace.axis, left, why)


def _untold(rival: Rival, kept: Trial) -> str:
    owner = kept.names[rival.place]
    if rival.candidate.entry.name == owner:
        other, own = _kinds(rival, kept)
        return f"as '{other}', cannot be told from '{own}'"
    return f"in its place, cannot be told from {owner}"


def _left_more(kept: Trial) -> str:
    alone, together = ("alone, ", " together") if len(kept.candidates) > 1 else ("", "")
    return (
        f"{alone}leaves more than the {significant(kept.misfit)} of {' and '.join(kept.names)}"
        f"{together}, on stretches that it did not see"
    )


def _own_share(trace: AxisTrace, without: Chain) -> float:
    """Share of the mean square before that is there again without one effect."""
    before, lacking, after = (
        trace.rms(chain) ** 2 for chain in (trace.chain, without, trace.extended)
    )
    return (lacking - after) / before


def _values(settled: Trial, place: int) -> tuple[Value, ...]:
    part, parameters = settled.part(place), settled.candidates[place].form.parameters
    numbers = zip(parameters, settled.fit.values[part], settled.fit.halfwidth[part], strict=True)
    return tuple(Value(parameter, float(v), float(half)) for parameter, v, half in numbers)


def _evidence(trace: AxisTrace, kept: Trial, place: int, without: Chain) -> Iterator[str]:
    selection = trace.selection
    lacking, after = (significant(1e9 * trace.rms(c)) for c in (without, trace.extended))
    risen = misfit(trace.evidence, without, taught=False)
    bands = sum(len(each.floor.rms) for each in trace.evidence)
    yield (
        f"on stretches that no fit saw, the residual in {trace.axis} is {lacking} nm rms without it"
        f" and {after} nm with it; its misfit, a sum over {bands} bands that is {bands} at the"
        f" floor, {significant(risen)} without and {significant(selection.misfit_after)} with it"
    )
    yield from _others(trace, kept, place)
    if like := _alike(trace, place):
        most = max(like, key=attrgetter("rms"))
        other, own = _kinds(most.rival, kept)
        yield (
            f"as '{other}' it would do as well; the scanner would move"
            f" {significant(1e9 * most.rms, 2)} nm rms otherwise, and the intervals hold if it is"
            f" '{own}'"
        )
    for value in _values(trace.settled or kept, place):
        if value.at_edge:
            yield (
                f"its {value.parameter.name} is at the edge of what the catalogue"
                " allows, so these records leave it open"
            )
    if place in trace.in_step:
        yield "it is in step with the drive: it may be what the model leaves of the motion itself"
    largest = max(float(ratio.max()) for ratio in trace.ratio_after)
    yield f"the largest band of what is left is {significant(largest, 2)} times its floor"


def _alike(trace: AxisTrace, place: int) -> list[Alike]:
    return [each for each in trace.selection.alike if each.rival.place == place]


def _kinds(rival: Rival, kept: Trial) -> tuple[str, str]:
    """Return what another form of an effect is called, and the one that was kept."""
    forms = rival.candidate, kept.candidates[rival.place]
    other, own = (each.entry.kind_words(each.form.kind) for each in forms)
    return other, own


def _others(trace: AxisTrace, kept: Trial, place: int) -> Iterator[str]:
    """Say what else was tried in its place; beside others only what does as well is known."""
    owner, selection = kept.names[place], trace.selection
    here = [r for r in selection.rivals if r.place == place and r.candidate.entry.name != owner]
    if here:
        left = (f"{r.candidate.entry.name} {significant(r.trial.misfit)}" for r in here)
        yield f"in its place do nearly as well, by the misfit that they leave: {', '.join(left)}"
    others = [trial for trial in selection.first if trial.names[0] != owner]
    if others and not here and len(kept.candidates) == 1:
        best = others[0]
        yield (
            f"of the others, each tried alone, {best.names[0]} does best for its price and leaves a"
            f" misfit of {significant(best.misfit)}"
        )
