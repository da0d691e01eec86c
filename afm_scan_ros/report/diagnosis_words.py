"""A diagnosis in words and rows of text, for the terminal and for the report alike."""

from collections.abc import Iterator, Sequence

from afm_scan_ros.core.diagnosis.axis_diagnosis import (
    AMBIGUOUS,
    FOUND,
    INSUFFICIENT,
    SUFFICIENT,
    UNEXPLAINED,
)
from afm_scan_ros.core.diagnosis.competing import CompetingModel
from afm_scan_ros.core.diagnosis.diagnosis import Diagnosis
from afm_scan_ros.core.diagnosis.residual_report import ResidualReport, most_excited_record
from afm_scan_ros.core.diagnosis.result import IdentifiedEffect, Value
from afm_scan_ros.core.diagnosis.suggestion import Suggestion
from afm_scan_ros.core.diagnosis.time_invariance import DISTURBANCE
from afm_scan_ros.core.effects.registry import entry
from afm_scan_ros.core.numerals import significant
from afm_scan_ros.report.harmonics import harmonic_rows
from afm_scan_ros.report.residual_words import chosen_words, residual_words
from afm_scan_ros.report.tables import nanometres
from afm_scan_ros.report.value_words import value_words

Row = tuple[str, ...]

RESIDUAL = ("residual", "floor, nm", "before, nm", "after, nm", "verdict")
UNSEEN = "This residual is rms of all records together, on the stretches that no fit saw."
EFFECTS = ("effect", "axis", "parameter", "value, 95 %")
TRIED = ("effect", "axis", "misfit left", "")
ORDER = (
    "The best first, by the misfit and the price of its parameters together: what has more of them"
    " may leave less and yet stand further down."
)

VERDICTS = {
    SUFFICIENT: "The model suffices: what it leaves rises nowhere above what the model discrepancy, the"
    " sensor's noise and chance explain.",
    FOUND: "An effect that the model lacks is found, and no other effect in the catalogue would do"
    " as well.",
    AMBIGUOUS: "An effect is missing in the model, and these records do not tell which of those"
    " named it is.",
    INSUFFICIENT: "These records hardly move the scanner, so they can show nothing of its model.",
    UNEXPLAINED: "Something is missing in the model, and nothing in the catalogue explains"
    " these records; the model is left as it was where this is so.",
}
"""What each verdict says."""

SUGGESTED = (
    "These equations were searched in the data alone. They name no mechanism and nothing of them"
    " is added to the model: they say where to look."
)

LIMITS = {
    "partly": "Feedforward removes it in part",
    "none": "Feedforward cannot remove it",
}


def effect_rows(found: Diagnosis) -> list[Row]:
    """Return a row for each parameter of each effect."""
    return [row for effect in found.effects for row in _parameters(effect)]


def alternative_rows(found: Diagnosis, *, ambiguous: bool) -> list[Row]:
    """Return a row for each alternative of the axes that are ambiguous, or of the others."""
    return [
        (_with_kind(a.name, a.kind_words), a.axis, significant(a.score), a.why_not)
        for a in found.alternatives
        if (found.by_axis[a.axis].verdict == AMBIGUOUS) is ambiguous
    ]


def share_words(effect: IdentifiedEffect) -> str:
    """Say what an effect's own share is."""
    share = f"Its own share is {significant(100.0 * effect.explained_fraction)} %"
    if effect.explained_fraction <= 1.0:
        return share
    return f"{share}, more than there was, for it and the others cancel in part"


def misfit_words(found: Diagnosis) -> Iterator[str]:
    """Yield what each axis' misfit is before and after, beside what it is where all is floor."""
    for axis, trace in found.by_axis.items():
        before, after = trace.selection.misfit_before, trace.selection.misfit_after
        bands = sum(len(evidence.floor.rms) for evidence in trace.evidence)
        fell = f", {significant(after)} once extended" if trace.final is not trace.chain else ""
        yield (
            f"Misfit in {axis}: {significant(before)}{fell}; it would be {bands} if each of the"
            f" {bands} bands of the records were at its floor."
        )


def form_words(effect: IdentifiedEffect) -> str:
    """Give an effect's equation, and where it has several say which was added."""
    listed = entry(effect.name)
    words = f"{effect.axis}, {effect.name}: {listed.equation}."
    if len(listed.forms) == 1:
        return words
    which = f"its kind '{effect.kind}'" if effect.kind else "the first of these"
    return f"{words} Added is {which}, by {', '.join(v.parameter.name for v in effect.values)}."


def residual_rows(found: Diagnosis) -> list[Row]:
    """Return a row for each axis: its floor, its residual before and after, and its verdict."""
    before, after, floor = found.rms_before, found.rms_after, found.noise_floor
    return [
        (
            axis,
            *(nanometres(of[axis]) for of in (floor, before, after)),
            trace.verdict.replace("_", " "),
        )
        for axis, trace in found.by_axis.items()
    ]


def conclusions(found: Diagnosis) -> Iterator[str]:
    """Yield what follows, in sentences: verdicts, rivals, what feedforward leaves, what hides."""
    verdicts = {axis: VERDICTS[trace.verdict] for axis, trace in found.by_axis.items()}
    if len(set(verdicts.values())) == 1:
        yield VERDICTS[found.verdict]
    else:
        yield from (f"{axis}: {said}" for axis, said in verdicts.items())
    for axis, trace in found.by_axis.items():
        of_axis = [effect for effect in found.effects if effect.axis == axis]
        for place, effect in enumerate(of_axis):
            competing_models = {
                _named(r, effect) for r in trace.selection.competing_models if r.place == place
            }
            if competing_models:
                yield f"{axis}: {effect.name}, or else {' or '.join(sorted(competing_models))}."
            if place in trace.synchronous_places:
                yield f"{axis}: {effect.name}, or else what the model leaves of the motion itself."
            if effect.equivalent:
                yield f"{axis}: {effect.name} *: {_if_so(effect)}."
            listed = entry(effect.name)
            if listed.remedy in LIMITS:
                yield f"{axis}: {effect.name}. {LIMITS[listed.remedy]}: {listed.advice}."
    yield from found.cautions


def unexplained_words(found: ResidualReport) -> Iterator[str]:
    """Yield what is known of each residual that stays unexplained, and what is suggested."""
    for axis, trace in found.diagnosis.by_axis.items():
        if trace.verdict == UNEXPLAINED:
            record = most_excited_record(trace)
            known = residual_words(found.before[axis][record], trace.evidence[record].floor)
            yield f"What is known of it in {axis}: {chosen_words(trace)}{' '.join(known)}"
    yield from (suggestion_words(each) for each in found.suggestions)


def suggestion_words(found: Suggestion) -> str:
    """Say what equation is suggested, and how much of the residual it explains."""
    return (
        f"Suggestion: {found.equation}, which explains {found.explained:.0%} of the residual's"
        " mean square on stretches that the search did not see."
    )


def _named(competing: CompetingModel, effect: IdentifiedEffect) -> str:
    name, kind = competing.candidate.entry.name, competing.candidate.form.kind
    return name if name != effect.name else f"'{entry(name).kind_words(kind)}'"


def _if_so(effect: IdentifiedEffect) -> str:
    """Say on what the intervals of an effect depend."""
    others = " or ".join(f"'{entry(effect.name).kind_words(kind)}'" for kind in effect.equivalent)
    own = entry(effect.name).kind_words(effect.kind)
    return f"as {others} it would do as well; the intervals hold if it is '{own}'"


def _with_kind(name: str, words: str) -> str:
    return f"{name}, {words}" if words else name


def _parameters(effect: IdentifiedEffect) -> Iterator[Row]:
    name, mark = (
        _with_kind(effect.name, entry(effect.name).kind_words(effect.kind)),
        " *" if effect.equivalent else "",
    )
    periodic = effect.name == DISTURBANCE
    for what, value in (harmonic_rows if periodic else _each)(effect.values):
        yield name, effect.axis, what, f"{value}{mark}"
        name = ""


def _each(values: Sequence[Value]) -> Iterator[tuple[str, str]]:
    for value in values:
        yield value.parameter.name.replace("_", " "), value_words(value)
