"""The report on a closed loop: rows, sentences and the page."""

from collections.abc import Callable, Iterable, Iterator, Sequence

from afm_scan_ros.core.closed_loop import FIRST, Round
from afm_scan_ros.core.comparison import ScanComparison
from afm_scan_ros.core.metrics import Tracking
from afm_scan_ros.core.trajectory import TO_AND_FRO
from afm_scan_ros.core.types import AXES
from afm_scan_ros.report import diagnosis_text as text
from afm_scan_ros.report.page import PageLink, Provenance, ReportPage, Section
from afm_scan_ros.report.page import Part as PagePart
from afm_scan_ros.report.picture import Picture
from afm_scan_ros.report.quantity import nanometres
from afm_scan_ros.report.scan_pictures import TwoScans, error_picture, image_picture, images_of
from afm_scan_ros.report.sentences import sentence
from afm_scan_ros.report.table import Part, Rows

Row = tuple[str, ...]

TRACKING = (
    "error, rms in nm:\nmodel → extended",
    "",
    "measured",
    "true",
    "true, at\nconst. speed",
    "true, at\nturns",
)
"""No wider than a terminal's 80 columns."""
RESIDUAL = ("residual, rms in nm", "axis", "detection limit", "model", "extended model")
NAMES = ("with the model's inverse", "with the extended model's inverse")


def _trial_rows(done: Round, cells: Callable[[ScanComparison, str], Iterable[str]]) -> list[Row]:
    """Return a row for each trial and axis: its name in x, below it what it is."""
    rows: list[Row] = []
    for name, trial in done.comparisons.items():
        spec = done.before[name].spec
        said = f"{spec.pattern}, {spec.line_rate:.4g} Hz, {1e6 * spec.range_x:.4g} µm"
        rows += [(f"{name}:", "x", *cells(trial, "x")), (said, "y", *cells(trial, "y"))]
    return rows


def _tracked(trial: ScanComparison, axis: str) -> Iterator[str]:
    yield _change(trial.measured_before, trial.measured_after, axis, "all")
    for part in ("all", "constant_speed", "turnarounds"):
        yield _change(trial.true_before, trial.true_after, axis, part)


def _left(trial: ScanComparison, axis: str) -> Iterator[str]:
    """Return the residual of the model and of the extended one, behind its limit."""
    rms = trial.residual[axis]
    return map(nanometres, (rms.floor, rms.before, rms.after))


def reported(rounds: Sequence[Round]) -> Round:
    """Return the last round whose model was kept, or else the first."""
    return next((done for done in reversed(rounds) if done.kept), rounds[0])


def round_result(done: Round) -> Iterator[Part]:
    """Yield what a round found and what its extended model changed, in sentences and tables."""
    yield from text.verdict_text(done.diagnosis)
    yield from text.effects(done.diagnosis)
    yield text.residuals(done.diagnosis)
    yield sentence("residual.of_all_records")
    if done.comparisons:
        yield Rows(TRACKING, _trial_rows(done, _tracked))
    yield from outcome(done)


def outcome(done: Round) -> Iterator[str]:
    """Yield what limits a round's verdict, and what its extended model changed."""
    yield from text.limits_text(done.diagnosis)
    if done.experiments:
        yield sentence("loop.experiments", names=done.experiments)
    if done.diagnosis.effects and not done.comparisons and not done.refusal:
        yield sentence("loop.complete")
    if done.refusal:
        yield sentence("loop.refused", why=done.refusal)
    for (name, axis), ratio in done.worse.items():
        yield sentence("loop.worse", name=name, axis=axis, ratio=ratio)
    yield from _reservations(done)
    if done.kept:
        yield sentence("loop.changed", change=done.comparisons[FIRST].change)
        if not done.improved:
            yield sentence("loop.not_improved")


def _reservations(done: Round) -> Iterator[str]:
    """Yield what the errors of these scans do not show."""
    effects = done.diagnosis.effects if done.comparisons else ()
    if any(effect.name == "drift" for effect in effects):
        yield sentence("loop.replayed")
    if own := sorted({e.name for e in effects if any(v.parameter.own for v in e.values)}):
        yield sentence("loop.own", names=own)


def final_text(rounds: Sequence[Round], failure: str = "") -> Iterator[str]:
    """Yield how the loop ended, in sentences; ``failure`` is what ended the next round, if any."""
    if failure:
        yield sentence("loop.failed", number=len(rounds) + 1, why=failure)
    kept = [done for done in rounds if done.improved]
    if not kept:
        yield sentence("loop.not_reduced")
        return
    first, last = kept[0].comparisons[FIRST], kept[-1].comparisons[FIRST]
    for axis in AXES:
        change = _change(first.measured_before, last.measured_after, axis, "all")
        yield sentence("loop.reduced", axis=axis, change=change)


def close_loop_report(rounds: Sequence[Round], of: Provenance, failure: str = "") -> ReportPage:
    """Return the report on the rounds; ``failure`` ended the next one, if any."""
    last = reported(rounds)
    found = last.diagnosis
    numbered = list(enumerate(rounds, 1))
    shown = next((n for n, done in numbered if done is last and done.comparisons), None)
    return ReportPage(
        title="Closed loop: scan, diagnose, extend, scan again",
        answer=[*text.brief(found), " ".join(final_text(rounds, failure))],
        picture=_lines(last, shown) if shown else None,
        next_steps=list(text.next_steps(found)),
        evidence=[
            *(_round(number, done, first=number == shown) for number, done in numbered),
            Section("Method", [sentence("loop.method")]),
        ],
        warnings=of.shortcomings,
        provenance=of,
    )


def _round(number: int, done: Round, *, first: bool) -> Section:
    """Return what a round found; its lines are elsewhere where it is shown ``first``."""
    parts: list[PagePart] = list(round_result(done))
    parts.append(PageLink(f"Diagnosis of round {number}", f"round_{number}/report.html"))
    if done.comparisons:
        parts += [Rows(RESIDUAL, _trial_rows(done, _left)), sentence("loop.unseen")]
        parts += [] if first else [_lines(done, number)]
        imaged = next(n for n, scan in done.before.items() if scan.spec.pattern in TO_AND_FRO)
        images = images_of(TwoScans.of(done.before[imaged], done.after[imaged], *NAMES))
        parts.append(image_picture(f"grating_{number}", images, f"as '{imaged}'"))
    return Section(f"Round {number}: {done.diagnosis.verdict.replace('_', ' ')}", parts)


def _lines(done: Round, number: int) -> Picture:
    scans = TwoScans.of(done.before[FIRST], done.after[FIRST], *NAMES)
    return error_picture(f"lines_{number}", scans)


def _change(before: Tracking | None, after: Tracking | None, axis: str, part: str) -> str:
    """Say how an error changed; an error that is not known is a dash."""
    figures = (getattr(getattr(t, axis), part) if t else None for t in (before, after))
    return " → ".join("-" if f is None else nanometres(f.rms) for f in figures)
