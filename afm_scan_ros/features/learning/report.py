"""The report on a learned scan: rows, sentences, pictures and the page."""

import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from attrs import frozen
from matplotlib.figure import Figure

from afm_scan_ros.core.diagnosis.diagnosis import ScannerDiagnosis
from afm_scan_ros.core.metrics import Figure as ErrorFigure
from afm_scan_ros.core.metrics import plain
from afm_scan_ros.core.types import AXES
from afm_scan_ros.features.learning.loop import LearningScan, best_of
from afm_scan_ros.report import html
from afm_scan_ros.report.diagnosis_text import effects as effects_text
from afm_scan_ros.report.diagnosis_text import next_steps, verdict_text
from afm_scan_ros.report.provenance import Provenance
from afm_scan_ros.report.quantity import nanometres, percent
from afm_scan_ros.report.scan_figures import TwoScans, error_figure
from afm_scan_ros.report.style import BLUE, NANO, ORANGE, blank, styled
from afm_scan_ros.report.table import Part, Rows

Document = dict[str, Any]

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
TEMPLATES = Path(__file__).parent / "templates"
DISPLACEMENTS = ("measured", "true")


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
    best, first = best_of(list(scans)), scans[0]
    for axis in AXES:
        yield (
            f"{axis}: measured error {nanometres(first.errors[axis])} nm rms before,"
            f" {nanometres(best.errors[axis])} nm in the best scan, number"
            f" {_number(scans, best)}."
        )
    yield from _limits(scans)


def _limits(scans: Sequence[LearningScan]) -> Iterator[str]:
    """Yield what did not repeat, what was restored, and what the drive's limits refused."""
    tests = [done.convergence for done in scans if done.convergence]
    for axis in AXES:
        if tests and tests[-1][axis].noise > 0.5 * scans[0].errors[axis]:
            yield (
                f"{axis}: the first two scans differ by as much as their error. Learn again when"
                " the scanner has settled, or with less noise."
            )
        if tests:
            last = tests[-1][axis]
            yield (
                f"{axis}: {nanometres(last.noise)} nm rms do not repeat from scan to scan. The"
                f" correction contains {nanometres(last.learned_noise)} nm rms of it."
            )
    for number, done in enumerate(scans, 1):
        if done.restored:
            yield (
                f"After scan {number - 1} the error of {' and '.join(done.restored)} had grown in"
                " some frequencies. There the best correction was restored and is kept."
            )
        if math.isinf(done.price):
            yield f"Scan {number} keeps the correction before it: the drive's limits leave no room."
        elif done.price:
            yield f"Scan {number} has less than the whole correction, as the drive is limited."


def taught_text(taught: Taught) -> Iterator[Part]:
    """Yield what the learned drive teaches the diagnosis."""
    yield from verdict_text(taught.diagnosis)
    yield from effects_text(taught.diagnosis)
    for axis in AXES:
        yield (
            f"{axis}: of the learned drive's displacement the model lacks"
            f" {nanometres(taught.before[axis])} nm rms, and the extended model"
            f" {nanometres(taught.after[axis])} nm."
        )


def learning_document(scans: Sequence[LearningScan], taught: Taught | None) -> Document:
    """Return the whole as JSON has it, in SI units."""
    document: Document = {
        "best_scan": _number(scans, best_of(list(scans))),
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


def learning_page(
    scans: Sequence[LearningScan], taught: Taught | None, of: Provenance, failure: str = ""
) -> str:
    """Return the report as a self-contained HTML page; ``failure`` ended the scans, if any."""
    best = best_of(list(scans))
    return html.page(
        "learning.html",
        TEMPLATES,
        failure=failure,
        learned=learning_text(scans),
        history=html.png(history_figure(scans)),
        spectrum=html.png(spectrum_figure(best)) if best.steps else None,
        lines=html.png(error_figure(_two(scans[0], best))),
        taught=taught and taught_text(taught),
        next_steps=taught and next_steps(taught.diagnosis),
        provenance=of,
    )


@styled
def history_figure(scans: Sequence[LearningScan]) -> Figure:
    """Draw the rms error of each axis by scan, measured and, where it is known, true."""
    figure = blank(9.6, 3.2)
    numbers = np.arange(1, len(scans) + 1)
    for panel, axis in zip(figure.subplots(1, 2, sharey=True), AXES, strict=True):
        errors = [_errors(done, axis) for done in scans]
        for name, colour, each in zip(
            DISPLACEMENTS, (ORANGE, BLUE), zip(*errors, strict=True), strict=True
        ):
            rms = [NANO * one.rms for one in each if one is not None]
            if len(rms) == len(scans):
                panel.semilogy(numbers, rms, "o-", color=colour, label=name)
        panel.set(xlabel="scan", title=f"{axis}, at constant speed")
        panel.set_xticks(numbers)
    figure.axes[0].set_ylabel("error, rms in nm")
    figure.axes[0].legend()
    return figure


@styled
def spectrum_figure(done: LearningScan) -> Figure:
    """Draw the correction and the response by frequency."""
    figure = blank(9.6, 3.2)
    left, right = figure.subplots(1, 2)
    for axis, colour in zip(AXES, (BLUE, ORANGE), strict=True):
        step = done.steps[axis]
        used = np.abs(step.correction) > 0.0
        used[0] = False
        hertz = step.frequencies[used]
        amplitude = 2.0 * NANO * np.abs(step.correction[used]) / step.length
        left.loglog(hertz, amplitude, ".", ms=1.5, color=colour, label=axis)
        right.loglog(hertz, np.abs(step.response.ratio[used]), ".", ms=1.5, color=colour)
    left.set(xlabel="frequency in Hz", ylabel="correction in nm")
    right.set(xlabel="frequency in Hz", ylabel="scanner over model")
    left.legend(markerscale=6)
    return figure


def _scan(done: LearningScan) -> Document:
    return {
        "tracking": {
            name: plain(done.scan.tracking(name)) for name in DISPLACEMENTS if _known(done, name)
        },
        "convergence": {axis: plain(test) for axis, test in done.convergence.items()},
        "restored": list(done.restored),
        "whole_correction": done.price == 0.0,
    }


def _known(done: LearningScan, displacement: str) -> bool:
    return displacement == DISPLACEMENTS[0] or done.scan.knows_true


def _errors(done: LearningScan, axis: str) -> list[ErrorFigure | None]:
    """Error at constant speed: measured, and true where it is known."""
    return [
        getattr(done.scan.tracking(name), axis).constant_speed if _known(done, name) else None
        for name in DISPLACEMENTS
    ]


def _rms(figure: ErrorFigure | None) -> str:
    return "-" if figure is None else nanometres(figure.rms)


def _number(scans: Sequence[LearningScan], one: LearningScan) -> int:
    return next(k for k, done in enumerate(scans, 1) if done is one)


def _two(first: LearningScan, best: LearningScan) -> TwoScans:
    known = first.scan.knows_true
    achieved = [done.scan.true if known else done.scan.measured for done in (first, best)]
    names = ("with the model's inverse", "with the learned correction")
    return TwoScans(first.scan.spec, first.scan.desired, (achieved[0], achieved[1]), names)
