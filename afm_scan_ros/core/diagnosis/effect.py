"""What is said of a traced effect, and of those that might stand for it."""

from collections.abc import Iterator
from enum import Enum
from operator import attrgetter

from attrs import evolve, frozen

from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.diagnosis.axis_trace import AMBIGUOUS, UNEXPLAINED, AxisTrace
from afm_scan_ros.core.diagnosis.evidence import misfit
from afm_scan_ros.core.diagnosis.forms import Alike
from afm_scan_ros.core.diagnosis.trial import Candidate, Trial
from afm_scan_ros.core.diagnosis.value import Value
from afm_scan_ros.core.effects.registry import effect_type


class WhyNot(Enum):
    """Why an alternative is not the effect that was kept."""

    SAME_EFFECT = "another form of the same effect"
    SAME_PLACE = "fits as well in its place"
    MODEL_ERROR = "model discrepancy that repeats with the motion"
    LARGER_MISFIT = "leaves a larger misfit"
    PARTIAL = "explains a part of the residual"


RUNNERS_UP = 3
MODEL_ERROR = "model_error"
"""Stands among the alternatives for what the model leaves of the motion itself."""


@frozen
class EffectEvidence:
    """What speaks for an effect, on stretches that no fit saw; lengths in m, rms.

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
class TracedEffect:
    """An effect of the catalogue on one axis, with its evidence.

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
    evidence: EffectEvidence


@frozen(eq=False)
class Alternative:
    """An effect that was tried; ``score`` is the misfit that it leaves (floors squared).

    One in step with the drive may be the model's own error, for which nothing is added: its score
    is the misfit without the effect. ``kept`` are the names of the effects that were kept
    (``kept_kind`` the form of the one in question) and ``kept_misfit`` is what they leave.
    """

    name: str
    kind: str
    axis: str
    score: float
    why_not: WhyNot
    kept: tuple[str, ...]
    kept_kind: str
    kept_misfit: float

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
            evidence=_evidence(trace, kept, place, without),
        )


def alternatives(trace: AxisTrace) -> Iterator[Alternative]:
    """Rivals where the axis is ambiguous; else the runners-up, and why they are not it."""
    selection, kept = trace.selection, trace.selection.kept
    if kept is None:
        return
    if trace.verdict == AMBIGUOUS:
        for rival in selection.rivals:
            own = kept.candidates[rival.place]
            same = rival.candidate.entry.name == own.entry.name
            why = WhyNot.SAME_EFFECT if same else WhyNot.SAME_PLACE
            found = _alternative(trace, rival.candidate, rival.trial, why)
            yield evolve(found, kept=(own.entry.name,), kept_kind=own.form.kind)
        yield from (_model_error(trace, kept, place) for place in trace.in_step)
        return
    why = WhyNot.PARTIAL if trace.verdict == UNEXPLAINED else WhyNot.LARGER_MISFIT
    for trial in selection.first[: RUNNERS_UP + 1]:
        if trace.verdict == UNEXPLAINED or trial.names[0] not in kept.names:
            yield _alternative(trace, trial.candidates[0], trial, why)


def _alternative(trace: AxisTrace, candidate: Candidate, trial: Trial, why: WhyNot) -> Alternative:
    kept = trace.selection.kept
    names, left = (kept.names, kept.misfit) if kept else ((), trace.selection.misfit_before)
    name, kind = candidate.entry.name, candidate.form.kind
    return Alternative(name, kind, trace.axis, trial.misfit, why, tuple(names), "", left)


def _model_error(trace: AxisTrace, kept: Trial, place: int) -> Alternative:
    """Model discrepancy that repeats with the motion, in the place of a disturbance."""
    left = misfit(trace.evidence, kept.without(trace.chain, place), taught=False)
    owner, why = (kept.names[place],), WhyNot.MODEL_ERROR
    return Alternative(MODEL_ERROR, "", trace.axis, left, why, owner, "", kept.misfit)


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


def _evidence(trace: AxisTrace, kept: Trial, place: int, without: Chain) -> EffectEvidence:
    most = max(_alike(trace, place), key=attrgetter("rms"), default=None)
    competing, runner_up = _others(trace, kept, place)
    return EffectEvidence(
        rms_without=trace.rms(without),
        rms_with=trace.rms(trace.extended),
        misfit_without=misfit(trace.evidence, without, taught=False),
        misfit_with=trace.selection.misfit_after,
        bands=sum(len(each.floor.rms) for each in trace.evidence),
        competing=competing,
        runner_up=runner_up,
        other_form=(most.rival.candidate.form.kind, most.rms) if most else None,
        synchronous=place in trace.in_step,
        largest_ratio=max(float(ratio.max()) for ratio in trace.ratio_after),
    )


def _alike(trace: AxisTrace, place: int) -> list[Alike]:
    return [each for each in trace.selection.alike if each.rival.place == place]


def _others(
    trace: AxisTrace, kept: Trial, place: int
) -> tuple[tuple[tuple[str, float], ...], tuple[str, float] | None]:
    """Return what fits nearly as well in its place, and the best of the others tried alone."""
    owner, selection = kept.names[place], trace.selection
    here = [r for r in selection.rivals if r.place == place and r.candidate.entry.name != owner]
    competing = tuple((r.candidate.entry.name, r.trial.misfit) for r in here)
    others = [trial for trial in selection.first if trial.names[0] != owner]
    if not others or here or len(kept.candidates) > 1:
        return competing, None
    return competing, (others[0].names[0], others[0].misfit)
