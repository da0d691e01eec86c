"""The report on a residual, as a page that reads like a short lab note."""

from collections.abc import Iterator, Mapping

from matplotlib.figure import Figure

from afm_scan_ros.core.diagnosis.axis_diagnosis import AxisDiagnosis
from afm_scan_ros.core.diagnosis.residual_report import ResidualReport, most_excited_record
from afm_scan_ros.core.diagnosis.time_invariance import DISTURBANCE
from afm_scan_ros.files.diagnosis_file import proposal
from afm_scan_ros.report import html
from afm_scan_ros.report.diagnosis_words import (
    EFFECTS,
    ORDER,
    RESIDUAL,
    SUGGESTED,
    TRIED,
    UNSEEN,
    Row,
    alternative_rows,
    conclusions,
    effect_rows,
    form_words,
    misfit_words,
    residual_rows,
    share_words,
    suggestion_words,
)
from afm_scan_ros.report.harmonics import CONVENTION
from afm_scan_ros.report.provenance import Provenance
from afm_scan_ros.report.provenance_section import provenance_section, warnings
from afm_scan_ros.report.residual_figures import residual_figure
from afm_scan_ros.report.residual_words import chosen_words, residual_words

METHOD = (
    "The residual is measured minus predicted displacement under the recorded drive, each without"
    " its mean. Its floor, band by band, is the sensor's noise and the error that is known of the"
    " model, in proportion to this record's motion; misfits are mean squares in units of it,"
    " summed over all bands of all records, so that one at its floor counts 1. Every"
    " effect of the catalogue was fitted to every other stretch of the records and judged on those"
    " between; one is kept where it lowers the misfit there by more than the price of its"
    " parameters and of the number of candidates. Intervals are of 95 %."
)
SHARES = (
    "Without an effect the others are as they were fitted beside it. Its own share is what comes"
    " back so of the mean square before, on stretches that no fit saw; those of several need not"
    " sum to 100 %."
)
CAPTION = (
    "The whole record. Orange: what the model leaves{extended}. By band,"
    " against the floor; over time; by position and by speed, with the scatter about the mean; the"
    " mean line to and fro (where there are no lines: by the way since the last turn);"
    " autocorrelation, with"
    " the 95 % bands of white noise (lines) and of a block bootstrap (grey)."
)


def pictures(found: ResidualReport) -> dict[str, bytes]:
    """Draw each axis' residual in the record where it is loudest, as PNG files have it."""
    by_axis = found.diagnosis.by_axis
    return {axis: html.png(_figure(found, trace)) for axis, trace in by_axis.items()}


def diagnosis_page(found: ResidualReport, drawn: Mapping[str, bytes], of: Provenance) -> str:
    """Return the report as a self-contained HTML page, with the pictures of the axes."""
    title = "What the scanner's residual was traced to"
    return html.page(title, *warnings(of), *_parts(found, drawn), *provenance_section(of))


def _figure(found: ResidualReport, trace: AxisDiagnosis) -> Figure:
    record = most_excited_record(trace)
    stages = [found.before[trace.axis][record]]
    if trace.final is not trace.chain:
        stages.append(found.after[trace.axis][record])
    return residual_figure(trace.evidence[record].floor, *stages)


def _parts(found: ResidualReport, drawn: Mapping[str, bytes]) -> Iterator[str]:
    diagnosis = found.diagnosis
    yield from (html.paragraph(sentence) for sentence in conclusions(diagnosis))
    yield html.table(RESIDUAL, residual_rows(diagnosis))
    yield html.paragraph(UNSEEN)
    yield from (html.paragraph(sentence) for sentence in misfit_words(diagnosis))
    yield html.heading("Records")
    yield html.table(("", "samples", "every", "x began", "y began"), _records(found))
    if diagnosis.effects:
        yield html.heading("What is added to the model")
        yield from _effects(found)
    if found.suggestions:
        yield html.heading("What no effect of the catalogue explains")
        yield html.paragraph(SUGGESTED)
        yield from (html.paragraph(suggestion_words(each)) for each in found.suggestions)
    if equivalent := alternative_rows(diagnosis, ambiguous=True):
        yield html.heading("What does as well")
        yield html.table(TRIED, equivalent)
    if tried := alternative_rows(diagnosis, ambiguous=False):
        yield html.heading("What else was tried")
        yield html.table(TRIED, tried)
        yield html.paragraph(ORDER)
    experiment = proposal(diagnosis.experiment)
    if experiment:
        yield html.heading("What to record next")
        yield html.paragraph(experiment)
    for axis in diagnosis.by_axis:
        yield from _residual(found, axis, drawn[axis])
    yield html.heading("Method")
    yield html.paragraph(METHOD)


def _records(found: ResidualReport) -> list[Row]:
    began = [[one.initial_state for one in found.before[axis]] for axis in found.before]
    return [
        (record.name, f"{len(record.drive.x):,}", f"{1e6 * record.sample_period:g} µs", *memories)
        for record, *memories in zip(found.diagnosis.observations, *began, strict=True)
    ]


def _effects(found: ResidualReport) -> Iterator[str]:
    yield html.table(EFFECTS, effect_rows(found.diagnosis))
    for effect in found.diagnosis.effects:
        said = "; ".join(effect.evidence)
        yield html.paragraph(form_words(effect))
        yield html.paragraph(f"{share_words(effect)}: {said}.")
    if any(effect.name == DISTURBANCE for effect in found.diagnosis.effects):
        yield html.paragraph(CONVENTION)
    yield html.paragraph(SHARES)


def _residual(found: ResidualReport, axis: str, drawn: bytes) -> Iterator[str]:
    trace = found.diagnosis.by_axis[axis]
    record = most_excited_record(trace)
    floor = trace.evidence[record].floor
    yield html.heading(f"The residual in {axis}")
    before = found.before[axis][record]
    words = " ".join(residual_words(before, floor))
    yield html.paragraph(f"{chosen_words(trace)}{before.record}: {words}")
    extended = ""
    if trace.final is not trace.chain:
        after = residual_words(found.after[axis][record], floor)
        yield html.paragraph(f"Once extended: {' '.join(after)}")
        extended = "; blue: what is left once extended"
    yield html.image(drawn, CAPTION.format(extended=extended))
