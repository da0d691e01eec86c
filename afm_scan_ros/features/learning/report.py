"""The report on a learned scan: rows, sentences, pictures and the page."""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
from attrs import frozen

from afm_scan_ros.core.diagnosis.diagnosis import ScannerDiagnosis
from afm_scan_ros.core.metrics import Figure as ErrorFigure
from afm_scan_ros.core.metrics import plain
from afm_scan_ros.core.types import AXES
from afm_scan_ros.features.learning.loop import LearningScan, best_of
from afm_scan_ros.report.diagnosis_json import Document
from afm_scan_ros.report.diagnosis_text import effects as effects_text
from afm_scan_ros.report.diagnosis_text import next_steps, verdict_text
from afm_scan_ros.report.page import CommandLine, Provenance, ReportPage, Section
from afm_scan_ros.report.picture import BLUE, NANO, ORANGE, Curve, Panel, Picture
from afm_scan_ros.report.quantity import nanometres, percent
from afm_scan_ros.report.scan_pictures import TwoScans, error_picture
from afm_scan_ros.report.sentences import Catalogue
from afm_scan_ros.report.table import Part, Rows

said = Catalogue(Path(__file__).parent / "templates" / "sentences.yaml")

HEADINGS = (
    "scan",
    "axis",
    "measured error,\nrms, nm",
    "at constant\nspeed, nm",
    "% of\nrange",
    "true, at const.\nspeed, nm",
    "next error over\nthis, at most",
    "share of error\nlearned",
)
DISPLACEMENTS = ("measured", "true")
NAMES = ("with the model's inverse", "with the learned correction")


@frozen(eq=False)
class Taught:
    """A diagnosis of the first scan and the learned one, and what each model lacks (m, rms)."""

    diagnosis: ScannerDiagnosis
    before: Mapping[str, float]
    after: Mapping[str, float]


def learning_rows(scans: Sequence[LearningScan]) -> Iterator[tuple[str, ...]]:
    """Yield a row for each scan and axis."""
    following = [*scans[1:], None]
    for number, (done, after) in enumerate(zip(scans, following, strict=True), 1):
        for axis in AXES:
            measured, true = _errors(done, axis)
            test = after.convergence.get(axis) if after else None
            yield (
                str(number) if axis == AXES[0] else "",
                axis,
                nanometres(done.errors[axis]),
                _rms(measured),
                "-" if measured is None else percent(measured.rms_share),
                _rms(true),
                "-" if test is None else f"{test.bound:.2f}",
                "-" if test is None else f"{test.learned:.0%}",
            )


def learning_text(scans: Sequence[LearningScan]) -> Iterator[Part]:
    """Yield what learning reached, as sentences and a table."""
    yield Rows(HEADINGS, learning_rows(scans))
    best, first = best_of(scans), scans[0]
    for axis in AXES:
        errors = {"first": first.errors[axis], "best": best.errors[axis]}
        yield said("learning.reached", axis=axis, number=scans.index(best) + 1, **errors)
    yield from _limits(scans)


def _limits(scans: Sequence[LearningScan]) -> Iterator[str]:
    """Yield what did not repeat, what was restored, and what the drive's limits refused."""
    tests = [done.convergence for done in scans if done.convergence]
    for axis, last in (tests[-1] if tests else {}).items():
        if last.noise > 0.5 * scans[0].errors[axis]:
            yield said("learning.unsettled", axis=axis)
        yield said("learning.noise", axis=axis, last=last)
    for number, done in enumerate(scans, 1):
        if done.restored:
            yield said("learning.restored", number=number - 1, axes=done.restored)
        if done.price:
            code = "no_room" if math.isinf(done.price) else "limited"
            yield said(f"learning.{code}", number=number)


def taught_text(taught: Taught) -> Iterator[Part]:
    """Yield what the learned drive teaches the diagnosis."""
    yield from verdict_text(taught.diagnosis)
    yield from effects_text(taught.diagnosis)
    for axis in AXES:
        rms = {"before": taught.before[axis], "after": taught.after[axis]}
        yield said("learning.lacking", axis=axis, **rms)


def learning_document(scans: Sequence[LearningScan], taught: Taught | None) -> Document:
    """Return the whole as JSON has it, in SI units."""
    document: Document = {
        "best_scan": scans.index(best_of(scans)) + 1,
        "scans": [_scan(done) for done in scans],
        "diagnosis": None,
    }
    if taught is not None:
        document["diagnosis"] = {
            "verdict": taught.diagnosis.verdict,
            "effects": [effect.name for effect in taught.diagnosis.effects],
            "lacking_rms_before_m": dict(taught.before),
            "lacking_rms_after_m": dict(taught.after),
        }
    return document


def learning_report(
    scans: Sequence[LearningScan],
    taught: Taught | None,
    of: Provenance,
    commands: Iterable[CommandLine],
    failure: str = "",
) -> ReportPage:
    """Return the report on the scans; ``failure`` ended them, if any.

    ``commands`` are those to be given next.
    """
    best = best_of(scans)
    compared = TwoScans.of(scans[0].scan, best.scan, *NAMES)
    sections = [Section("Errors of each scan", list(learning_text(scans)))]
    sections.append(Section("Error by scan", [history_picture(scans)]))
    if best.steps:
        sections.append(Section("What was learned, by frequency", [spectrum_picture(best)]))
    if taught is not None:
        sections.append(Section("What the model lacks", list(taught_text(taught))))
    return ReportPage(
        title="A scan learned from its errors",
        answer=list(_answer(scans, best)),
        picture=error_picture("lines", compared),
        next_steps=[*commands, *(next_steps(taught.diagnosis) if taught else ())],
        evidence=[*sections, Section("Method", [said("learning.method")])],
        warnings=[said("learning.ended", why=failure)] if failure else [],
        provenance=of,
    )


def _answer(scans: Sequence[LearningScan], best: LearningScan) -> Iterator[str]:
    first = scans[0]
    errors = {axis: (first.errors[axis], best.errors[axis]) for axis in AXES}
    yield said("learning.changed", errors=errors)
    tests = [done.convergence for done in scans if done.convergence]
    if tests:
        yield said("learning.repeats", tests=tests[-1])
    else:
        yield said("learning.best", number=scans.index(best) + 1, count=len(scans))


def history_picture(scans: Sequence[LearningScan]) -> Picture:
    """Show the rms error of each axis by scan, measured and, where it is known, true."""
    numbers = np.arange(1.0, len(scans) + 1.0)
    panels = []
    for axis in AXES:
        curves = []
        every = zip(*(_errors(done, axis) for done in scans), strict=True)
        for errors, name, colour in zip(every, DISPLACEMENTS, (ORANGE, BLUE), strict=True):
            rms = np.array([NANO * one.rms for one in errors if one is not None])
            if len(rms) == len(scans):
                curves.append(Curve(numbers, rms, name, colour))
                curves.append(Curve(numbers, rms, "", colour, dots=True))
        panels.append(Panel(curves, "scan", "error in nm rms", f"{axis}, at constant speed", "y"))
    return Picture("history", "Error by scan. Measured errors hold noise.", [panels])


def spectrum_picture(done: LearningScan) -> Picture:
    """Show the correction and the response by frequency."""
    corrections, responses = [], []
    for axis, colour in zip(AXES, (BLUE, ORANGE), strict=True):
        step = done.steps[axis]
        used = np.abs(step.correction) > 0.0
        used[0] = False
        hertz = step.frequencies[used]
        amplitude = 2.0 * NANO * np.abs(step.correction[used]) / step.length
        corrections.append(Curve(hertz, amplitude, axis, colour, dots=True))
        ratio = np.abs(step.response.ratio[used])
        responses.append(Curve(hertz, ratio, axis, colour, dots=True))
    label = "frequency in Hz"
    row = [
        Panel(corrections, label, "correction in nm", log="xy"),
        Panel(responses, label, "scanner over model", log="xy"),
    ]
    return Picture("spectrum", said("learning.spectrum"), [row])


def _scan(done: LearningScan) -> Document:
    return {
        "tracking": {name: plain(done.scan.tracking(name)) for name in _known(done)},
        "convergence": {axis: plain(test) for axis, test in done.convergence.items()},
        "restored": list(done.restored),
        "whole_correction": done.price == 0.0,
    }


def _known(done: LearningScan) -> tuple[str, ...]:
    return DISPLACEMENTS if done.scan.knows_true else DISPLACEMENTS[:1]


def _errors(done: LearningScan, axis: str) -> list[ErrorFigure | None]:
    """Error at constant speed: measured, and true where it is known."""
    errors = [getattr(done.scan.tracking(n), axis).constant_speed for n in _known(done)]
    return [*errors, None][: len(DISPLACEMENTS)]


def _rms(figure: ErrorFigure | None) -> str:
    return "-" if figure is None else nanometres(figure.rms)
