"""What is said of a traced effect, and of those that might stand for it."""

from collections.abc import Iterator
from operator import attrgetter

from attrs import frozen

from afm_scan_ros.core.catalogue.entry import Parameter
from afm_scan_ros.core.tracing.axis_trace import AMBIGUOUS, FOUND, UNEXPLAINED, AxisTrace
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

    ``explained_fraction`` is the share of the residual's mean square that all effects of the axis
    explain together.
    """

    name: str
    kind: str
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
    before, after = trace.rms(trace.chain), trace.rms(trace.extended)
    share = 1.0 - (after / before) ** 2
    for place, candidate in enumerate(kept.candidates):
        evidence = tuple(_evidence(trace, kept, place))
        name, kind = candidate.entry.name, candidate.form.kind
        yield TracedEffect(name, kind, trace.axis, _values(settled, place), share, evidence)


def alternatives(trace: AxisTrace) -> Iterator[Alternative]:
    """Rivals where the axis is ambiguous; else the runners-up, and why they are not it."""
    selection = trace.selection
    if trace.verdict == AMBIGUOUS:
        for rival in selection.rivals:
            yield _alternative(trace, rival.candidate, rival.trial, _untold(rival, selection.kept))
        return
    if selection.kept is None:
        return
    why = {
        FOUND: f"leaves more than {selection.kept.misfit:.3g} on stretches that it did not see",
        UNEXPLAINED: "explains a part of the residual, and leaves what no effect would leave",
    }
    for trial in selection.first[: RUNNERS_UP + 1]:
        if trace.verdict == UNEXPLAINED or trial.names[0] not in selection.kept.names:
            yield _alternative(trace, trial.candidates[0], trial, why[trace.verdict])


def _alternative(trace: AxisTrace, candidate: Candidate, trial: Trial, why: str) -> Alternative:
    return Alternative(candidate.entry.name, trace.axis, trial.misfit, why)


def _untold(rival: Rival, kept: Trial | None) -> str:
    if kept and rival.candidate.entry.name == kept.names[rival.place]:
        return f"as kind {rival.candidate.form.kind!r} cannot be told from the kind of the first"
    return "cannot be told from the first"


def _values(settled: Trial, place: int) -> tuple[Value, ...]:
    part, parameters = settled.part(place), settled.candidates[place].form.parameters
    numbers = zip(parameters, settled.fit.values[part], settled.fit.halfwidth[part], strict=True)
    return tuple(Value(parameter, float(v), float(half)) for parameter, v, half in numbers)


def _evidence(trace: AxisTrace, kept: Trial, place: int) -> Iterator[str]:
    selection = trace.selection
    yield (
        f"on stretches that no fit saw, the residual in {trace.axis} falls from"
        f" {1e9 * trace.rms(trace.chain):.3g} to {1e9 * trace.rms(trace.extended):.3g} nm rms;"
        f" in units of the floor its misfit falls from {selection.misfit_before:.3g} to"
        f" {selection.misfit_after:.3g}"
    )
    others = [t for t in selection.first if t.names[0] != kept.names[place]]
    if others and place == 0:
        yield f"the next best for its price, {others[0].names[0]}, leaves {others[0].misfit:.3g}"
    like = [each for each in selection.alike if each.rival.place == place]
    if like:
        most = max(like, key=attrgetter("rms"))
        yield (
            f"as kind {most.rival.candidate.form.kind!r} it would do as well; the scanner would"
            f" move {1e9 * most.rms:.2g} nm rms otherwise"
        )
    if place in trace.in_step:
        yield "it is in step with the drive: it may be what the model leaves of the motion itself"
    largest = max(float(ratio.max()) for ratio in trace.ratio_after)
    yield f"the largest band of what is left is {largest:.2g} times its floor"
