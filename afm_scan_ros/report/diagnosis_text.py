"""A diagnosis as sentences and table rows, for terminal and report."""

import math
from collections.abc import Iterator
from decimal import ROUND_DOWN, Context

from afm_scan_ros.core.diagnosis import cautions
from afm_scan_ros.core.diagnosis.axis_diagnosis import (
    AMBIGUOUS,
    FOUND,
    INSUFFICIENT,
    SUFFICIENT,
    UNEXPLAINED,
    AxisDiagnosis,
)
from afm_scan_ros.core.diagnosis.coupled.diagnosis import CoupledDiagnosis
from afm_scan_ros.core.diagnosis.diagnosis import ScannerDiagnosis
from afm_scan_ros.core.diagnosis.discrepancy import MotionByBand
from afm_scan_ros.core.diagnosis.experiments import Proposal
from afm_scan_ros.core.diagnosis.residual_report import ResidualReport, most_excited_record
from afm_scan_ros.core.diagnosis.result import Alternative, IdentifiedEffect, WhyNot
from afm_scan_ros.core.effects.registry import effect_type
from afm_scan_ros.core.identification.drives.experiments import EXPERIMENTS
from afm_scan_ros.report.quantity import harmonic_rows, nanometres, significant, value_text
from afm_scan_ros.report.residual import chosen_text, residual_text
from afm_scan_ros.report.table import Part, Rows

Row = tuple[str, ...]

EXPERIMENTED = "experiments"
"""Folder for a proposed experiment, or for its drive."""

SMALLEST, MOST_PROBABLE = 1e-3, 5
"""Smallest probability that is written, and how many sets of effects a sentence holds."""
RESIDUAL = ("axis", "verdict", "residual, model,\nrms in nm", "extended\nmodel", "detection\nlimit")
HELD_OUT = "Residuals are rms of all records, on stretches that the values were not fitted to."
EFFECTS = ("effect", "axis", "parameter", "value, 95 % interval")
TRIED = ("effects", "axis", "probability", "why they are not added")

VERDICTS = {
    SUFFICIENT: "The model is sufficient. No band of the residual exceeds its detection limit by"
    " more than chance explains.",
    FOUND: "The model lacks what is named here, each effect with a probability of 95 % or more.",
    AMBIGUOUS: "The model lacks an effect. These records do not determine which of the competing"
    " effects it is.",
    INSUFFICIENT: "These records hardly move the scanner, so they cannot test its model.",
    UNEXPLAINED: "The residual exceeds its detection limit at some frequencies, and no effect in"
    " the catalogue explains it. The model is not extended.",
}
"""Sentences for each verdict."""

LIMITS = {
    "feedforward": "The inverse of the extended model compensates it",
    "partly": "Feedforward compensates it in part",
    "none": "Feedforward cannot compensate it",
}


def verdict_text(found: ScannerDiagnosis) -> Iterator[str]:
    """Yield the verdict, axis by axis where the axes differ, and where an excess is unexplained."""
    verdicts = {axis: VERDICTS[diagnosed.verdict] for axis, diagnosed in found.by_axis.items()}
    if len(set(verdicts.values())) == 1:
        yield VERDICTS[found.verdict]
    else:
        yield from (f"{axis}: {text}" for axis, text in verdicts.items())
    for axis, diagnosed in found.by_axis.items():
        if diagnosed.verdict == UNEXPLAINED:
            yield f"{axis}: {_excess_text(diagnosed)}"


def _excess_text(diagnosed: AxisDiagnosis) -> str:
    """Say in which band the residual is largest, and that its rms over all may be below."""
    record = most_excited_record(diagnosed)
    ratio, edges = diagnosed.ratio_before[record], diagnosed.evidence[record].limit.edges
    band = int(ratio.argmax())
    text = (
        f"the residual is {significant(float(ratio[band]), 2)} times its detection limit from"
        f" {edges[band]:g} to {edges[band + 1]:g} Hz."
    )
    if diagnosed.rms_before <= diagnosed.limit:
        text += " Its rms over all frequencies, which the table states, is below the limit."
    return text


def result(found: ScannerDiagnosis) -> Iterator[Part]:
    """Yield verdict, effects, probabilities, errors before and after, and what limits it all."""
    yield from verdict_text(found)
    yield from effects(found)
    yield from probabilities(found)
    yield residuals(found)
    yield HELD_OUT
    yield from limits_text(found)


def brief(found: ScannerDiagnosis) -> Iterator[str]:
    """Yield what the model lacks where effects are found, or else the verdicts but a sufficient."""
    named = [f"{effect.name.replace('_', ' ')} in {effect.axis}" for effect in found.effects]
    if found.verdict == FOUND and named:
        yield f"The model lacks {' and '.join(named)}, with a probability of 95 % or more."
        return
    lacking = [(a, d.verdict) for a, d in found.by_axis.items() if d.verdict != SUFFICIENT]
    yield from (f"{axis}: {VERDICTS[verdict]}" for axis, verdict in lacking)
    if not lacking:
        yield VERDICTS[found.verdict]


def effects(found: ScannerDiagnosis) -> Iterator[Rows]:
    """Yield a table of the effects, a row for each parameter; nothing where none is found."""
    if found.effects:
        yield Rows(EFFECTS, [row for effect in found.effects for row in _parameters(effect)])


def residuals(found: ScannerDiagnosis) -> Rows:
    """Return a row for each axis: its verdict, its residual before and after, and its limit."""
    figures = found.rms_before, found.rms_after, found.noise_floor
    rows = [
        (axis, diagnosed.verdict.replace("_", " "), *(nanometres(of[axis]) for of in figures))
        for axis, diagnosed in found.by_axis.items()
    ]
    return Rows(RESIDUAL, rows)


def next_steps(found: ScannerDiagnosis) -> Iterator[str]:
    """Yield what to do next: what to record, or how to use the extended model."""
    experiment = next_experiment(found)
    if experiment:
        yield experiment
    elif found.verdict == SUFFICIENT:
        if any(each.untested for one in found.by_axis.values() for each in one.evidence):
            yield f"The error of such motion is hardly known: it may hide an effect. {HEALTHY}"
        else:
            yield "Nothing above the detection limit: scan with this model."
    elif any(value.at_edge for effect in found.effects for value in effect.values):
        yield (
            "Do not scan with model.extended.yaml: a value in it is not determined. Diagnose a"
            " further record of other motion too, or identify the scanner anew."
        )
    elif found.effects:
        yield "Scan with model.extended.yaml in place of the model."
    else:
        yield (
            "Every proposed experiment is recorded. The description of the residual states what it"
            " depends on: look there for the cause."
        )
    for effect in found.effects:
        listed = effect_type(effect.name)
        advice = listed.advice[0].upper() + listed.advice[1:]
        yield f"{effect.axis}: {effect.name}. {LIMITS[listed.remedy]}. {advice}."


HEALTHY = (
    "Record such motion on the scanner while it is healthy, and diagnose again with that record as"
    " --healthy, in Python as healthy."
)


def next_experiment(found: ScannerDiagnosis) -> str | None:
    """Say what to record next; None where no experiment is proposed."""
    proposals = [HEALTHY] if found.untested else []
    if found.proposal is not None:
        proposals.append(proposal(found.proposal))
    return " Or else: ".join(proposals) or None


def proposal(of: Proposal) -> str:
    """Say how to record an experiment, on any scanner, and what to do with its record."""
    sized = of.experiment
    command = f"afm-scan calibrate --experiment {sized.name}"
    command += f" --amplitude {_three_digits(sized.amplitude)}V" if sized.amplitude else ""
    command += f" --duration {_three_digits(sized.duration)}s"
    return (
        f"Record the experiment {sized.name} ({EXPERIMENTS[sized.name].purpose}),"
        f" {_size_text(of)}.{_expected_text(of)}"
        f" '{command} --export {EXPERIMENTED}' writes its drive as CSV for your converter, of the"
        " size of your scanner with this model's file as --model."
        f" '{command} --out {EXPERIMENTED}' records it of a simulated scanner, with the --plant of"
        " these records. Then diagnose its record together with these."
    )


def _three_digits(value: float) -> str:
    """Round toward zero, so that no limit of the drive is exceeded."""
    given = f"{value:.7g}"  # without what binary numbers add
    return f"{float(Context(prec=3, rounding=ROUND_DOWN).create_decimal(given)):g}"


def _size_text(of: Proposal) -> str:
    sized = of.experiment
    moved = "" if math.isnan(of.motion) else f" ({significant(1e6 * of.motion)} µm in {of.axis})"
    amplitude = f"with an amplitude of {significant(sized.amplitude)} V{moved}"
    length = f"{significant(sized.duration)} s long"
    return f"{amplitude}, {length}" if sized.amplitude else length


def _expected_text(of: Proposal) -> str:
    if math.isnan(of.bits):
        return ""
    return f" It is expected to give at least {of.bits:.2f} bits on the effects in {of.axis}."


def alternative_rows(found: ScannerDiagnosis) -> list[Row]:
    """Return a row for each alternative."""
    return [
        (_with_kind(a.name, a.kind_label), a.axis, probability_text(a.probability), why_not_text(a))
        for a in found.alternatives
    ]


def probability_text(probability: float) -> str:
    """Write a probability with three decimals; a dash where there is none."""
    if math.isnan(probability):
        return "-"
    return "< 0.001" if probability < SMALLEST else f"{probability:.3f}"


WHY_NOT = {
    WhyNot.CREDIBLE: "within the 95 % credible set of {selected}",
    WhyNot.LESS_PROBABLE: "less probable than {selected}",
    WhyNot.INADEQUATE: "leaves more than the detection limit explains",
    WhyNot.MODEL_ERROR: "model discrepancy that repeats with the motion cannot be distinguished"
    " from {selected}",
    WhyNot.UNTESTED: "the model's error is not known for such a motion",
    WhyNot.UNSETTLED: "as it fits these records, its simulation diverges",
}


def why_not_text(other: Alternative) -> str:
    """Say why an alternative is not what was selected."""
    return WHY_NOT[other.why_not].format(selected=" and ".join(other.selected) or "no effect")


def share_text(effect: IdentifiedEffect) -> str:
    """Say what an effect's own share is."""
    percent = significant(100.0 * effect.explained_fraction)
    share = f"Its share of the residual's mean square is {percent} %"
    if effect.explained_fraction <= 1.0:
        return f"{share}."
    return f"{share}. This is more than all of it, because effects cancel in part."


def evidence_text(effect: IdentifiedEffect) -> Iterator[str]:
    """Yield the evidence for an effect, in sentences."""
    of = effect.evidence
    lacking, after = (significant(1e9 * rms) for rms in (of.rms_without, of.rms_with))
    yield (
        f"On the held-out stretches the residual in {effect.axis} is {lacking} nm rms without it"
        f" and {after} nm rms with it."
    )
    yield (
        f"Its probability is {probability_text(effect.probability)}. The log likelihood with it"
        f" exceeds that without it by {significant(of.nats)} nats."
    )
    yield from _doubts(effect)
    yield f"The largest remaining band is {significant(of.largest_ratio, 2)} times its limit."


def _doubts(effect: IdentifiedEffect) -> Iterator[str]:
    for value in effect.values:
        if value.at_edge:
            yield (
                f"Its {value.parameter.name} is at the edge of the catalogue's range, so these"
                " records do not determine it."
            )
    if effect.evidence.synchronous:
        yield "It repeats with the motion, so it may be model discrepancy."


def probabilities(found: ScannerDiagnosis | CoupledDiagnosis) -> Iterator[str]:
    """Yield each axis' most probable sets of effects."""
    for axis, by_set in found.probabilities.items():
        ranked = sorted(by_set.items(), key=lambda each: -each[1])
        stated = ", ".join(f"{name} {probability_text(p)}" for name, p in ranked[:MOST_PROBABLE])
        yield f"Probability in {axis}: {stated}."


def form_text(effect: IdentifiedEffect) -> str:
    """Give an effect's equation, and where it has several state which was added."""
    listed = effect_type(effect.name)
    text = f"{effect.axis}, {effect.name}: {listed.equation}."
    if len(listed.forms) == 1:
        return text
    which = f"its kind '{effect.kind}'" if effect.kind else "the first of these"
    names = ", ".join(v.parameter.name for v in effect.values)
    return f"{text} The model is extended by {which}, with {names}."


def limits_text(found: ScannerDiagnosis) -> Iterator[str]:
    """Yield competing effects, other forms, and cautions."""
    for axis, diagnosed in found.by_axis.items():
        of_axis = [effect for effect in found.effects if effect.axis == axis]
        if diagnosed.verdict == AMBIGUOUS:
            yield from _credible(found, axis)
        for place, effect in enumerate(of_axis):
            if place in diagnosed.synchronous_places:
                yield f"{axis}: {effect.name}, or model discrepancy that repeats with the motion."
            if diagnosed.untested:
                yield f"{axis}: {effect.name}, or the model's own error."
            if effect.equivalent:
                yield f"{axis}: {effect.name} *: {_if_so(effect)}."
    yield from map(caution_text, found.cautions)


def caution_text(of: cautions.Caution) -> str:
    """Say what limits a verdict."""
    if isinstance(of, cautions.SingleRate):
        return (
            f"{of.axis}: the model was tested at {of.low:g} to {of.high:g} Hz alone. Its hysteresis"
            " may then contain lag, delay or viscosity. These may be hidden, or stand for the"
            " effect that is named. Identify the model with loops at several rates."
        )
    if isinstance(of, cautions.UntestedMotion):
        tested = f" The model was tested with at least {_motion(of.tested)}." if of.tested else ""
        return (
            f"{of.axis}: the model's error is not known for the motion of {of.record},"
            f" {_motion(of.motion)}.{tested} What the record shows may be this error."
        )
    if isinstance(of, cautions.UnlikeHealthy):
        return (
            f"{of.axis}: {of.record} leaves {of.ratio:.2g} times the model's detection limit from"
            f" {of.low:g} to {of.high:g} Hz, and raises it. The other healthy records do not show"
            " such an error. If the scanner was not healthy then, leave this record out."
        )
    return _above_limit(of)


def _motion(of: MotionByBand) -> str:
    return f"{nanometres(of.size)} nm rms at {of.low:g} to {of.high:g} Hz"


def _above_limit(of: cautions.AboveDetectionLimit) -> str:
    why = "No effect is significant. It may be chance, or an effect too small to identify."
    if of.others:
        why = (
            "The other records do not share it. The scanner may have changed between them. Diagnose"
            " each record by itself."
        )
    return (
        f"{of.axis}: the residual of {of.record} is {of.ratio:.2g} times its detection limit from"
        f" {of.low:g} to {of.high:g} Hz. {why}"
    )


def unexplained_text(found: ResidualReport) -> Iterator[str]:
    """Yield what is known of each residual that stays unexplained."""
    for axis, diagnosed in found.diagnosis.by_axis.items():
        if diagnosed.verdict == UNEXPLAINED:
            yield f"The residual in {axis}: {described(found, axis)}"


def described(found: ResidualReport, axis: str) -> str:
    """Say what is known of the residual of an axis in the record that shows most of it."""
    diagnosed = found.diagnosis.by_axis[axis]
    record = most_excited_record(diagnosed)
    before, limit = found.before[axis][record], diagnosed.evidence[record].limit
    return f"{chosen_text(diagnosed)}{before.record}: {' '.join(residual_text(before, limit))}"


def _credible(found: ScannerDiagnosis, axis: str) -> Iterator[str]:
    """Yield what else is in the credible set."""
    others = [a.name for a in found.alternatives if a.axis == axis and a.why_not is WhyNot.CREDIBLE]
    own = " + ".join(effect.name for effect in found.effects if effect.axis == axis)
    if others:
        yield f"{axis}: {own}, or {', or '.join(others)}."


def _if_so(effect: IdentifiedEffect) -> str:
    """Say on what the intervals of an effect depend."""
    others = " or ".join(
        f"'{effect_type(effect.name).kind_label(kind)}'" for kind in effect.equivalent
    )
    own = effect_type(effect.name).kind_label(effect.kind)
    return f"as {others} it fits as well; the intervals hold if it is '{own}'"


def _with_kind(name: str, kind: str) -> str:
    return f"{name}, {kind}" if kind else name


def _parameters(effect: IdentifiedEffect) -> Iterator[Row]:
    name = _with_kind(effect.name, effect_type(effect.name).kind_label(effect.kind))
    mark = " *" if effect.equivalent else ""
    values = ((value.parameter.name, value_text(value)) for value in effect.values)
    for what, value in harmonic_rows(effect.values) if effect.periodic else values:
        yield name, effect.axis, what, f"{value}{mark}"
        name = ""
