"""A diagnosis as sentences and table rows, for terminal and report."""

from collections.abc import Iterator
from decimal import ROUND_DOWN, Context

from afm_scan_ros.core.diagnosis.axis_diagnosis import (
    AMBIGUOUS,
    FOUND,
    SUFFICIENT,
    UNEXPLAINED,
    AxisDiagnosis,
)
from afm_scan_ros.core.diagnosis.cautions import Caution
from afm_scan_ros.core.diagnosis.coupled.diagnosis import CoupledDiagnosis
from afm_scan_ros.core.diagnosis.diagnosis import ScannerDiagnosis
from afm_scan_ros.core.diagnosis.experiments import Proposal
from afm_scan_ros.core.diagnosis.residual_report import ResidualReport, most_excited_record
from afm_scan_ros.core.diagnosis.result import Alternative, IdentifiedEffect, WhyNot
from afm_scan_ros.core.effects.effect_type import EffectType
from afm_scan_ros.core.effects.registry import effect_type
from afm_scan_ros.core.identification.drives.experiments import EXPERIMENTS
from afm_scan_ros.report.quantity import harmonic_rows, nanometres, probability, value_text
from afm_scan_ros.report.residual import chosen_text, residual_text
from afm_scan_ros.report.sentences import sentence
from afm_scan_ros.report.table import Part, Rows

Row = tuple[str, ...]

MOST_PROBABLE = 5
"""How many sets of effects a sentence holds."""
RESIDUAL = ("axis", "verdict", "residual, model,\nrms in nm", "extended\nmodel", "detection\nlimit")
EFFECTS = ("effect", "axis", "parameter", "value, 95 % interval")
TRIED = ("effects", "axis", "probability", "why they are not added")


def verdict_text(found: ScannerDiagnosis) -> Iterator[str]:
    """Yield the verdict, axis by axis where the axes differ, and where an excess is unexplained."""
    verdicts = {axis: diagnosed.verdict for axis, diagnosed in found.by_axis.items()}
    if len(set(verdicts.values())) == 1:
        yield sentence(f"verdict.{found.verdict}")
    else:
        yield from (f"{axis}: {sentence(f'verdict.{each}')}" for axis, each in verdicts.items())
    yield from (_excess(d) for d in found.by_axis.values() if d.verdict == UNEXPLAINED)


def _excess(diagnosed: AxisDiagnosis) -> str:
    """Say in which band the residual is largest, and that its rms over all may be below."""
    record = most_excited_record(diagnosed)
    ratio, edges = diagnosed.ratio_before[record], diagnosed.evidence[record].limit.edges
    band = int(ratio.argmax())
    return sentence(
        "residual.excess",
        axis=diagnosed.axis,
        ratio=float(ratio[band]),
        low=edges[band],
        high=edges[band + 1],
        below=diagnosed.rms_before <= diagnosed.limit,
    )


def result(found: ScannerDiagnosis) -> Iterator[Part]:
    """Yield verdict, effects, probabilities, errors before and after, and what limits it all."""
    yield from verdict_text(found)
    yield from effects(found)
    yield from probabilities(found)
    yield residuals(found)
    yield sentence("residual.of_all_records")
    yield from limits_text(found)


def brief(found: ScannerDiagnosis) -> Iterator[str]:
    """Yield what the model lacks where effects are found, or else the verdicts but a sufficient."""
    named = [f"{effect.name.replace('_', ' ')} in {effect.axis}" for effect in found.effects]
    if found.verdict == FOUND and named:
        yield sentence("verdict.named", effects=named)
        return
    lacking = [(a, d.verdict) for a, d in found.by_axis.items() if d.verdict != SUFFICIENT]
    yield from (f"{axis}: {sentence(f'verdict.{verdict}')}" for axis, verdict in lacking)
    if not lacking:
        yield sentence(f"verdict.{found.verdict}")


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
    if experiment := next_experiment(found):
        yield experiment
    elif found.verdict == SUFFICIENT:
        untested = any(each.untested for one in found.by_axis.values() for each in one.evidence)
        code = "untested" if untested else "sufficient"
        yield sentence(f"next.{code}", healthy=sentence("next.healthy"))
    elif any(value.at_edge for effect in found.effects for value in effect.values):
        yield sentence("next.undetermined")
    else:
        yield sentence("next.extended" if found.effects else "next.exhausted")
    for effect in found.effects:
        yield f"{effect.axis}: {remedy_text(effect_type(effect.name))}"


def remedy_text(listed: EffectType) -> str:
    """Say what feedforward can do against an effect, and what else can be done."""
    remedy = sentence(f"remedy.{listed.remedy}")
    return sentence("next.effect", name=listed.name, remedy=remedy, advice=listed.advice)


def next_experiment(found: ScannerDiagnosis) -> str | None:
    """Say what to record next; None where no experiment is proposed."""
    proposals = [sentence("next.healthy")] if found.untested else []
    if found.proposal is not None:
        proposals.append(proposal(found.proposal))
    return " Or else: ".join(proposals) or None


def proposal(of: Proposal) -> str:
    """Say how to record an experiment, on any scanner, and what to do with its record."""
    sized = of.experiment
    command = f"afm-scan calibrate --experiment {sized.name}"
    command += f" --amplitude {_three_digits(sized.amplitude)}V" if sized.amplitude else ""
    command += f" --duration {_three_digits(sized.duration)}s"
    purpose = EXPERIMENTS[sized.name].purpose
    return sentence("next.experiment", of=of, sized=sized, purpose=purpose, command=command)


def _three_digits(value: float) -> str:
    """Round toward zero, so that no limit of the drive is exceeded."""
    given = f"{value:.7g}"  # without what binary numbers add
    return f"{float(Context(prec=3, rounding=ROUND_DOWN).create_decimal(given)):g}"


def alternative_rows(found: ScannerDiagnosis) -> list[Row]:
    """Return a row for each alternative."""
    return [
        (_with_kind(a.name, a.kind_label), a.axis, probability(a.probability), why_not_text(a))
        for a in found.alternatives
    ]


def why_not_text(other: Alternative) -> str:
    """Say why an alternative is not what was selected."""
    selected = " and ".join(other.selected) or "no effect"
    return sentence(f"why_not.{other.why_not.name}", selected=selected)


def share_text(effect: IdentifiedEffect) -> str:
    """Say what an effect's own share is."""
    return sentence("evidence.share", of=effect)


def evidence_text(effect: IdentifiedEffect) -> Iterator[str]:
    """Yield the evidence for an effect, in sentences."""
    of = effect.evidence
    yield sentence("evidence.residual", axis=effect.axis, of=of)
    yield sentence("evidence.probability", known=effect.probability, of=of)
    at_edge = (value.parameter.name for value in effect.values if value.at_edge)
    yield from (sentence("evidence.at_edge", name=name) for name in at_edge)
    if of.synchronous:
        yield sentence("evidence.synchronous")
    yield sentence("evidence.largest_band", of=of)


def probabilities(found: ScannerDiagnosis | CoupledDiagnosis) -> Iterator[str]:
    """Yield each axis' most probable sets of effects."""
    for axis, by_set in found.probabilities.items():
        ranked = sorted(by_set.items(), key=lambda each: -each[1])
        stated = ", ".join(f"{name} {probability(p)}" for name, p in ranked[:MOST_PROBABLE])
        yield f"Probability in {axis}: {stated}."


def form_text(effect: IdentifiedEffect) -> str:
    """Give an effect's equation, and where it has several state which was added."""
    return sentence("evidence.form", of=effect, listed=effect_type(effect.name))


def limits_text(found: ScannerDiagnosis) -> Iterator[str]:
    """Yield competing effects, other forms, and cautions."""
    for axis, diagnosed in found.by_axis.items():
        of_axis = [effect for effect in found.effects if effect.axis == axis]
        rivals = (a for a in found.alternatives if a.why_not is WhyNot.CREDIBLE)
        others = [each.name for each in rivals if each.axis == axis]
        if diagnosed.verdict == AMBIGUOUS and others:
            own = " + ".join(effect.name for effect in of_axis)
            yield sentence("limit.credible", axis=axis, own=own, others=others)
        for place, effect in enumerate(of_axis):
            if place in diagnosed.synchronous_places:
                yield sentence("limit.synchronous", of=effect)
            if diagnosed.untested:
                yield sentence("limit.untested", of=effect)
            if effect.equivalent:
                label = effect_type(effect.name).kind_label
                yield sentence("limit.equivalent", of=effect, label=label)
    yield from map(caution_text, found.cautions)


def caution_text(of: Caution) -> str:
    """Say what limits a verdict."""
    return sentence(f"caution.{type(of).__name__}", of=of)


def unexplained_text(found: ResidualReport) -> Iterator[str]:
    """Yield what is known of each residual that stays unexplained."""
    for axis, diagnosed in found.diagnosis.by_axis.items():
        if diagnosed.verdict == UNEXPLAINED:
            yield sentence("residual.unexplained", axis=axis, said=described(found, axis))


def described(found: ResidualReport, axis: str) -> str:
    """Say what is known of the residual of an axis in the record that shows most of it."""
    diagnosed = found.diagnosis.by_axis[axis]
    record = most_excited_record(diagnosed)
    before, limit = found.before[axis][record], diagnosed.evidence[record].limit
    return f"{chosen_text(diagnosed)}{before.record}: {' '.join(residual_text(before, limit))}"


def _with_kind(name: str, kind: str) -> str:
    return f"{name}, {kind}" if kind else name


def _parameters(effect: IdentifiedEffect) -> Iterator[Row]:
    name = _with_kind(effect.name, effect_type(effect.name).kind_label(effect.kind))
    mark = " *" if effect.equivalent else ""
    values = ((value.parameter.name, value_text(value)) for value in effect.values)
    for what, value in harmonic_rows(effect.values) if effect.periodic else values:
        yield name, effect.axis, what, f"{value}{mark}"
        name = ""
