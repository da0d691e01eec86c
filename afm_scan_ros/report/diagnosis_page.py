"""The report on a residual: the page, and the folder that holds it."""

from collections.abc import Iterator, Mapping
from pathlib import Path

from matplotlib.figure import Figure

from afm_scan_ros.core.diagnosis.axis_diagnosis import AxisDiagnosis
from afm_scan_ros.core.diagnosis.diagnosis import ScannerDiagnosis
from afm_scan_ros.core.diagnosis.residual_report import ResidualReport, most_excited_record
from afm_scan_ros.core.metrics import plain
from afm_scan_ros.files.model_file import save_model
from afm_scan_ros.report import html
from afm_scan_ros.report.diagnosis_json import account_document, save_diagnosis
from afm_scan_ros.report.diagnosis_text import (
    SUGGESTED,
    TRIED,
    Row,
    alternative_rows,
    evidence_text,
    form_text,
    next_steps,
    result,
    share_text,
    suggestion_text,
)
from afm_scan_ros.report.provenance import Provenance, heading_lines, provenance_section, warnings
from afm_scan_ros.report.quantity import CONVENTION
from afm_scan_ros.report.residual import (
    chosen_text,
    initial_state_text,
    residual_figure,
    residual_text,
)

METHOD = (
    "The residual is measured minus predicted displacement under the recorded drive, each without"
    " its mean. The detection limit of a band is sensor noise plus model discrepancy, which scales"
    " with the record's motion. The likelihood of a residual is Student's t distribution in each"
    " band. The probability of a set of effects follows from its evidence over all data, by"
    " Laplace's method. An effect is named where its probability is 95 % or more and no band lacks"
    " anything. Residuals in nm are of held-out stretches: the values are then fitted to the other"
    " stretches. Intervals are 95 % intervals."
)
SHARES = (
    "The share of an effect is the part of the held-out mean square that returns when it alone is"
    " left out. The other effects keep their fitted values. Shares of several effects need not sum"
    " to 100 %."
)
CAPTION = (
    "The residual over the whole record. Top: rms by frequency band, and over time. Middle: by"
    " position and by speed, mean and standard deviation. Bottom left: the mean line, or by travel"
    " since the last turning point where the record has no lines. Bottom right: autocorrelation,"
    " drawn as its range in each interval of lag."
)


def pictures(found: ResidualReport) -> dict[str, bytes]:
    """Draw each axis' residual in the record where it is loudest, as PNG files have it."""
    by_axis = found.diagnosis.by_axis
    return {axis: html.png(_figure(found, diagnosed)) for axis, diagnosed in by_axis.items()}


def diagnosis_page(found: ResidualReport, drawn: Mapping[str, bytes], of: Provenance) -> str:
    """Return the report as a self-contained HTML page, with the pictures of the axes."""
    title = "ScannerDiagnosis of a scanner's residual"
    parts = (*answer(found.diagnosis), *_parts(found, drawn))
    return html.page(title, *warnings(of), *parts, *provenance_section(of))


def answer(found: ScannerDiagnosis) -> Iterator[str]:
    """Yield the first section: verdict, effects, error before and after, what to do next."""
    yield html.heading("Result")
    yield from html.texts(result(found))
    yield html.heading("What to do next")
    yield from html.texts(next_steps(found))


def _figure(found: ResidualReport, diagnosed: AxisDiagnosis) -> Figure:
    record = most_excited_record(diagnosed)
    stages = [found.before[diagnosed.axis][record]]
    if diagnosed.final is not diagnosed.chain:
        stages.append(found.after[diagnosed.axis][record])
    return residual_figure(diagnosed.evidence[record].limit, *stages)


def _parts(found: ResidualReport, drawn: Mapping[str, bytes]) -> Iterator[str]:
    diagnosis = found.diagnosis
    if diagnosis.effects:
        yield html.heading("Evidence for the effects")
        yield from _effects(found)
    if found.suggestions:
        yield html.heading("Equations that no effect of the catalogue contains")
        yield html.paragraph(SUGGESTED)
        yield from html.texts(map(suggestion_text, found.suggestions))
    if tried := alternative_rows(diagnosis):
        yield html.heading("Alternatives")
        yield html.table(TRIED, tried)
    for axis in diagnosis.by_axis:
        yield from _residual(found, axis, drawn[axis])
    yield html.heading("Records")
    headings = ("record", "samples", "sample period", "x at the start", "y at the start")
    yield html.table(headings, _records(found))
    yield html.heading("Method")
    yield html.paragraph(METHOD)


def _records(found: ResidualReport) -> list[Row]:
    began = [map(initial_state_text, found.before[axis]) for axis in found.before]
    return [
        (record.name, f"{len(record.drive.x):,}", f"{1e6 * record.sample_period:g} µs", *states)
        for record, *states in zip(found.diagnosis.observations, *began, strict=True)
    ]


def _effects(found: ResidualReport) -> Iterator[str]:
    for effect in found.diagnosis.effects:
        yield html.paragraph(form_text(effect))
        yield html.paragraph(" ".join((share_text(effect), *evidence_text(effect))))
    if any(effect.periodic for effect in found.diagnosis.effects):
        yield html.paragraph(CONVENTION)
    yield html.paragraph(SHARES)


def _residual(found: ResidualReport, axis: str, drawn: bytes) -> Iterator[str]:
    diagnosed = found.diagnosis.by_axis[axis]
    record = most_excited_record(diagnosed)
    limit = diagnosed.evidence[record].limit
    yield html.heading(f"The residual in {axis}")
    before = found.before[axis][record]
    text = " ".join(residual_text(before, limit))
    yield html.paragraph(f"{chosen_text(diagnosed)}{before.record}: {text}")
    if diagnosed.final is not diagnosed.chain:
        after = residual_text(found.after[axis][record], limit)
        yield html.paragraph(f"With the extended model: {' '.join(after)}")
    yield html.image(drawn, CAPTION)


def write_diagnosis(folder: Path, found: ResidualReport, heading: str, of: Provenance) -> None:
    """Write all files of a diagnosis; ``heading`` begins the comment at the head of the model's."""
    folder.mkdir(parents=True, exist_ok=True)
    drawn = pictures(found)
    save_diagnosis(folder / "diagnosis.json", {**account_document(found), "provenance": plain(of)})
    head = f"{heading}\n{heading_lines(of)}"
    save_model(folder / "model.extended.yaml", found.diagnosis.model, head)
    (folder / "report.html").write_text(diagnosis_page(found, drawn, of), "utf-8")
    for axis, content in drawn.items():
        (folder / f"residual_{axis}.png").write_bytes(content)
