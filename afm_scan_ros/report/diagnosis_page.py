"""The report on a residual, as a page that reads like a short lab note."""

from collections.abc import Iterator

from afm_scan_ros.core.catalogue import entry
from afm_scan_ros.core.tracing.diagnosis import Diagnosis
from afm_scan_ros.files.diagnosis_file import proposal
from afm_scan_ros.report import html
from afm_scan_ros.report.diagnosis_figures import spectrum_figure
from afm_scan_ros.report.diagnosis_words import (
    EFFECTS,
    RESIDUAL,
    conclusions,
    effect_rows,
    residual_rows,
)

BANDS = (
    "Rms of measured minus predicted displacement in each band of frequency, of the record where"
    " it exceeds its floor most. The floor is the sensor's noise and the known error of the model,"
    " taken in proportion to this record's motion."
)


def diagnosis_page(found: Diagnosis) -> str:
    """Return the report as a self-contained HTML page."""
    return html.page("What the scanner's residual was traced to", *_parts(found))


def _parts(found: Diagnosis) -> Iterator[str]:
    yield from (html.paragraph(sentence) for sentence in conclusions(found))
    yield html.table(RESIDUAL, residual_rows(found))
    if found.effects:
        yield html.heading("What is added to the model")
        yield html.table(EFFECTS, effect_rows(found))
        for effect in found.effects:
            yield html.paragraph(f"{effect.axis}: {effect.name}: {entry(effect.name).equation}.")
            yield from (html.paragraph(sentence) for sentence in effect.evidence)
    if found.alternatives:
        yield html.heading("What else was tried")
        rows = [(a.name, a.axis, f"{a.score:.3g}", a.why_not) for a in found.alternatives]
        yield html.table(("effect", "axis", "misfit left", "why not"), rows)
    experiment = proposal(found.experiment)
    if experiment:
        yield html.heading("What to record next")
        yield html.paragraph(experiment)
    yield html.heading("The residual by band")
    yield html.picture(spectrum_figure(found), BANDS)
