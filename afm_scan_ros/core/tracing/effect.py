"""What is said of a traced effect, and of those that might stand for it."""

from collections.abc import Iterator
from operator import attrgetter

from attrs import frozen

from afm_scan_ros.core.catalogue.entry import Parameter
from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.numerals import significant
from afm_scan_ros.core.tracing.axis_trace import AMBIGUOUS, FOUND, UNEXPLAINED, AxisTrace
from afm_scan_ros.core.tracing.evidence import misfit
from afm_scan_ros.core.tracing.forms import Alike
from afm_scan_ros.core.tracing.kind_words import kind_words
from afm_scan_ros.core.tracing.rivals import Rival
from afm_scan_ros.core.tracing.trial import Candidate, Trial

RUNNERS_UP = 3


@frozen(eq=False)
class Value:
    """A parameter's value in its unit, with its 95 % interval."""

    parameter: Parameter
    value: float
    halfwidth: float


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
    """An effect that was tried; ``score`` is the misfit that it leaves (floors squared)."""

    name: str
    axis: str
    score: float
    why_not: str


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
        return
    why = {
        FOUND: _left_more(kept),
        UNEXPLAINED: "explains a part of the residual, and leaves what no effect would leave",
    }
    for trial in selection.first[: RUNNERS_UP + 1]:
        if trace.verdict == UNEXPLAINED or trial.names[0] not in kept.names:
            yield _alternative(trace, trial.candidates[0], trial, why[trace.verdict])


def _alternative(trace: AxisTrace, candidate: Candidate, trial: Trial, why: str) -> Alternative:
    return Alternative(candidate.entry.name, trace.axis, trial.misfit, why)


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
    yield (
        f"on stretches that no fit saw, the residual in {trace.axis} is {lacking} nm rms without it"
        f" and {after} nm with it; its misfit, in units of the floor, {significant(risen)} without"
        f" and {significant(selection.misfit_after)} with it"
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
    if place in trace.in_step:
        yield "it is in step with the drive: it may be what the model leaves of the motion itself"
    largest = max(float(ratio.max()) for ratio in trace.ratio_after)
    yield f"the largest band of what is left is {significant(largest, 2)} times its floor"


def _alike(trace: AxisTrace, place: int) -> list[Alike]:
    return [each for each in trace.selection.alike if each.rival.place == place]


def _kinds(rival: Rival, kept: Trial) -> tuple[str, str]:
    """Return what another form of an effect is called, and the one that was kept."""
    forms = rival.candidate, kept.candidates[rival.place]
    other, own = (kind_words(each.entry.name, each.form.kind) for each in forms)
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
