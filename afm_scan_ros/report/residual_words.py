"""What is known of a residual, in sentences."""

from collections.abc import Iterator

import numpy as np

from afm_scan_ros.core.diagnosis.axis_diagnosis import AxisDiagnosis
from afm_scan_ros.core.diagnosis.describe import Description
from afm_scan_ros.core.diagnosis.discrepancy import DetectionLimit
from afm_scan_ros.core.diagnosis.residual_report import most_excited_record
from afm_scan_ros.core.numerals import significant
from afm_scan_ros.report.tables import nanometres

TOLD = 0.3
"""Share from which a dependence or a coherence is worth a sentence."""
RULES = 2.0
"""How many times larger one of trace and retrace's parts is than the other, to be called so."""

CHANCE = 0.05
"""Share of white noise's autocorrelation that lies outside its 95 % band."""
PATTERN = (
    "What is at its floor may do so too: a model discrepancy is a pattern, and no white noise."
)
UNLIKE_LINES = {"speed", "amplitude", "time"}
CONFOUNDED = (
    "; in a scan the preparation differs from the lines in speed, amplitude and time at once"
)
"""What goes with one of these may be of another of them."""

QUANTITIES = {
    "position": "position",
    "speed": "speed",
    "travel": "the way since the motion last turned round",
    "amplitude": "the amplitude of the motion nearby",
    "time": "time",
}


def residual_words(one: Description, floor: DetectionLimit) -> Iterator[str]:
    """Yield what is known of a residual, the size of it first."""
    yield _size(one, floor)
    yield from _repeats(one)
    yield from _sides(one)
    yield from _goes_with(one)
    yield from _coheres(one, floor)
    if one.lines:
        lines = ", ".join(f"{line:.4g} Hz ({nanometres(size)} nm)" for line, size in one.lines)
        yield f"Lines stand out, with so much rms over the whole record: {lines}."
    yield (
        f"{one.own.outside_white:.0%} of its autocorrelation lies outside the 95 % band of white"
        f" noise, {one.own.outside_bootstrap:.0%} of what is beyond its own memory outside that of"
        " a block bootstrap."
    )
    if one.own.outside_white > CHANCE:
        yield PATTERN


def chosen_words(trace: AxisDiagnosis) -> str:
    """Say which of several records is described, and why; nothing where there is but one."""
    if len(trace.evidence) == 1:
        return ""
    peaks = [significant(float(ratio.max()), 2) for ratio in trace.ratio_before]
    names = [evidence.playback.view.name for evidence in trace.evidence]
    chosen = most_excited_record(trace)
    others = (f"{peaks[i]} in {name}" for i, name in enumerate(names) if i != chosen)
    return (
        f"Described is {names[chosen]}, where the residual stands highest above its floor:"
        f" {peaks[chosen]} times in its loudest band, {', '.join(others)}."
        " The JSON describes each. "
    )


def _size(one: Description, floor: DetectionLimit) -> str:
    ratio = one.bands / floor.rms
    most_excited_record = int(np.argmax(ratio))
    low, high = floor.edges[most_excited_record], floor.edges[most_excited_record + 1]
    return (
        f"{nanometres(one.rms)} nm rms over the whole record, of a floor of"
        f" {nanometres(floor.total)} nm; loudest from {low:g} to {high:g} Hz,"
        f" {significant(ratio[most_excited_record], 2)} times its floor there."
    )


def _repeats(one: Description) -> Iterator[str]:
    if one.repeats:
        yield (
            f"On the lines {one.repeats.to_scan:.0%} of it repeats from line to line,"
            f" {one.repeats.to_time:.0%} moves whole lines in the course of time, and"
            f" {one.repeats.rest:.0%} does neither."
        )


def _sides(one: Description) -> Iterator[str]:
    if one.sides is None:
        return
    equivalent, unlike = one.sides.equivalent, one.sides.unlike
    ruled = "place and direction alike"
    if equivalent > RULES * unlike:
        ruled = "place"
    elif unlike > RULES * equivalent:
        ruled = "direction"
    yield (
        f"Trace and retrace share {nanometres(equivalent)} nm rms and lie {nanometres(unlike)} nm"
        f" rms"
        f" to either side of that: a matter of {ruled}."
    )


def _goes_with(one: Description) -> Iterator[str]:
    shares = {name: each.share for name, each in one.dependences.items()}
    progress = sorted((n for n in shares if shares[n] > TOLD), key=shares.__getitem__, reverse=True)
    if not progress:
        return
    listed = ", ".join(f"{QUANTITIES[name]} ({shares[name]:.0%})" for name in progress)
    mixed = CONFOUNDED if one.repeats and UNLIKE_LINES.intersection(progress) else ""
    yield f"Of its mean square so much goes with one quantity alone: {listed}{mixed}."


def _coheres(one: Description, floor: DetectionLimit) -> Iterator[str]:
    heard = []
    for name, each in one.coherences.items():
        values = np.nan_to_num(each.values)
        best = int(np.argmax(values))
        if values[best] > max(TOLD, each.chance):
            low, high = floor.edges[best], floor.edges[best + 1]
            heard.append(f"the {name} ({values[best]:.2f}, {low:g} to {high:g} Hz)")
    if heard:
        yield f"It coheres with {', '.join(heard)}."
