"""The report on a closed loop: what each round found, and what it brought."""

from collections.abc import Iterator, Sequence

from afm_scan_ros.core.closed_loop.loop import Round
from afm_scan_ros.core.closed_loop.test_scans import FIRST
from afm_scan_ros.core.trajectory.kinds import TO_AND_FRO
from afm_scan_ros.report import html
from afm_scan_ros.report.close_loop_figures import error_figure, image_figure, images_of
from afm_scan_ros.report.close_loop_words import (
    RESIDUAL,
    TRACKING,
    final_words,
    outcome,
    tracking_rows,
    trial_residual_rows,
)
from afm_scan_ros.report.diagnosis_words import EFFECTS, effect_rows, residual_rows
from afm_scan_ros.report.diagnosis_words import RESIDUAL as TAUGHT
from afm_scan_ros.report.diagnosis_words import UNSEEN as TESTED
from afm_scan_ros.report.provenance import Provenance
from afm_scan_ros.report.provenance_section import provenance_section
from afm_scan_ros.report.tables import nanometres

HOW = (
    "Scans are made with the model's inverses by the nodes as processes; the residual of the first"
    " is traced to effects that the model lacks; the model with them added is inverted, and all"
    " scans are made anew. Errors are achieved minus desired displacement, rms about zero, nothing"
    " fitted, the first to-and-fro left out; for y 'constant speed' is on trace. 'Measured' holds"
    " the sensor's noise, 'true' does not."
)
UNSEEN = (
    "What both models leave of the whole of the scans made with the extended inverse, none of which"
    " any fit saw: measured minus predicted displacement, mean left out."
)


def close_loop_page(rounds: Sequence[Round], of: Provenance, failure: str = "") -> str:
    """Return the report as a self-contained HTML page; ``failure`` ended the next round, if any."""
    parts = [part for number, done in enumerate(rounds, 1) for part in _round(number, done)]
    words = [html.paragraph(sentence) for sentence in final_words(rounds, failure)]
    parts += provenance_section(of)
    return html.page("The loop closed with measured data", html.paragraph(HOW), *words, *parts)


def _round(number: int, done: Round) -> Iterator[str]:
    found = done.diagnosis
    yield html.heading(f"Round {number}: {found.verdict.replace('_', ' ')}")
    yield from (html.paragraph(sentence) for sentence in outcome(done))
    yield html.table(TAUGHT, residual_rows(found))
    yield html.paragraph(TESTED)
    if found.effects:
        yield html.table(EFFECTS, effect_rows(found))
    yield f'<p><a href="round_{number}/report.html">How it was traced</a></p>'
    if done.comparisons:
        yield from _scans(done)


def _scans(done: Round) -> Iterator[str]:
    yield html.table(TRACKING, tracking_rows(done))
    yield html.table(RESIDUAL, trial_residual_rows(done))
    yield html.paragraph(UNSEEN)
    figure = error_figure(done.before[FIRST], done.after[FIRST])
    yield html.picture(figure, "True error of the same scan before and after")
    imaged = next(n for n, scan in done.before.items() if scan.spec.pattern in TO_AND_FRO)
    images = images_of(done.before[imaged], done.after[imaged])
    before, after = (nanometres(images.wrong(image)) for image in (images.before, images.after))
    yield html.picture(
        image_figure(images),
        f"A grating of 16 µm imaged by '{imaged}', drawn on the expected path: heights wrong by"
        f" {before} nm rms before and {after} nm after, of 100 nm",
    )
