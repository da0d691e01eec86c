"""The report on a survey: sentences, rows, figures and the page."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from afm_scan_ros.features.survey.changes import Change, Course, by_instrument, courses
from afm_scan_ros.features.survey.recording import (
    QUANTITIES,
    RESIDUAL,
    EffectValue,
    NamedEffect,
    Recording,
)
from afm_scan_ros.report import picture
from afm_scan_ros.report.page import UNSTATED, CommandLine, Listing, ReportPage, Section
from afm_scan_ros.report.quantity import nanometres, quantity, significant
from afm_scan_ros.report.scan_pictures import LOW
from afm_scan_ros.report.sentences import Catalogue
from afm_scan_ros.report.table import Part, Rows

said = Catalogue(Path(__file__).parent / "templates" / "sentences.yaml")

PLACE = "{instrument}"
"""What stands for an instrument in the name of a model's file."""
SURVEYED = ("instrument", "recordings", "not diagnosed", "verdicts", "result")


@frozen
class Survey:
    """All recordings of a survey, what changed, and the probability of a false change."""

    recordings: Sequence[Recording]
    changes: Sequence[Change]
    false_alarm: float

    @property
    def failed(self) -> list[Recording]:
        """Recordings that could not be diagnosed."""
        return [each for each in self.recordings if each.error]

    @property
    def changed(self) -> dict[str, list[Change]]:
        """Changes by instrument, the surest first."""
        found: dict[str, list[Change]] = {}
        for change in self.changes:
            found.setdefault(change.instrument, []).append(change)
        return found

    @property
    def instruments(self) -> Rows:
        """A row for each instrument."""
        every = by_instrument(self.recordings)
        return Rows(SURVEYED, [_instrument_row(name, some, self) for name, some in every])


def alert(changes: Sequence[Change]) -> str:
    """Say in a line what changed of an instrument, the surest change first."""
    first, *others = changes
    return said(
        "survey.alert",
        instrument=first.instrument,
        what=_what(first),
        factor=_factor(first),
        after=_time(first.after),
        before=_time(first.before),
        others=[_what(each) for each in others],
        effects=first.effects,
    )


def summary(found: Survey) -> Iterator[Part]:
    """Yield what was surveyed, and an alert for each instrument that changed."""
    yield found.instruments
    for each in found.failed:
        yield said("survey.not_diagnosed", of=each)
    for each in found.recordings:
        if not each.error and not each.recorded:
            yield said("survey.no_time", of=each)
    yield from map(alert, found.changed.values())


CHANGES = ("instrument", "what changed", "by a factor of", "between", "and", "diagnosis")
LISTED = (
    "recording", "instrument", "time", "verdict", "effects", "residual over limit",
    "residual, nm", "detection limit, nm", "parameters of the effects", "samples", "bag",
)  # fmt: skip
SHOWN = LISTED.index("residual, nm")
"""Columns of the table of recordings; the others are seen in a row that is opened."""


def survey_report(
    found: Survey, reports: Mapping[str, str], model: str, now: datetime
) -> ReportPage:
    """Return the report; ``reports`` are the addresses of those of single bags.

    ``PLACE`` in the name of the ``model`` file stands for the instrument.
    """
    recordings = found.recordings
    versions = sorted({each.version for each in recordings})
    models = sorted({each.model for each in recordings})
    changes = [Rows(CHANGES, [_change_row(each) for each in found.changes])]
    when = f"{now:%Y-%m-%dT%H:%M:%SZ}"
    written = said("survey.written", when=when, versions=versions)
    listing = Listing(LISTED, [_listed(each, reports) for each in recordings], SHOWN)
    return ReportPage(
        title="Survey of recordings",
        answer=list(_answer(found)),
        picture=_trends(found),
        next_steps=list(_next(found, model)),
        evidence=[
            Section("Recordings", [listing], opened=True),
            *([Section("Changes", changes)] if found.changes else []),
            Section("Instruments", [found.instruments]),
            Section("Method", [said("survey.method", false_alarm=found.false_alarm)]),
            Section("Provenance", [written, said("survey.models", models=models)]),
        ],
    )


def _answer(found: Survey) -> Iterator[str]:
    """Yield how many instruments changed and which, or that none did."""
    count = len(list(by_instrument(found.recordings)))
    yield said("survey.changed", found=found, count=count)
    for some in list(found.changed.values())[:1]:
        yield said("survey.surest", alert=alert(some).removeprefix("alert: "))


def _next(found: Survey, model: str) -> Iterator[str | CommandLine]:
    for name, some in list(found.changed.items())[:1]:
        of_it = (r for r in found.recordings if r.instrument == name)
        bags = [r.bag for r in of_it if r.recorded >= some[0].before][:2]
        file = model.replace(PLACE, name)
        words = ["diagnose", *bags, "--model", file, "--out", f"{name}_diagnosis"]
        yield CommandLine(said("survey.diagnose", name=name), words)
    yield said("survey.go_on")


def _change_row(change: Change) -> tuple[str, ...]:
    ends = _time(change.after), _time(change.before)
    named = ", ".join(change.effects) or "names no effect"
    return change.instrument, _what(change), _factor(change), *ends, named


def _listed(each: Recording, reports: Mapping[str, str]) -> list[str | float]:
    """Return a row of the table of recordings: the address of its report, and a cell a column."""
    ratios = [q.value for axis in each.axes for q in axis.estimates if q.name == RESIDUAL]
    return [
        reports.get(each.bag, ""),
        Path(each.bag).name,
        each.instrument,
        _time(each.recorded),
        "not diagnosed" if each.error else each.verdict.replace("_", " "),
        each.error or ", ".join(f"{e.name} of {e.axis}" for e in each.effects) or "none",
        float(f"{max(ratios):.4g}") if ratios else "",
        ", ".join(f"{axis.axis} {nanometres(axis.residual)}" for axis in each.axes),
        ", ".join(f"{axis.axis} {nanometres(axis.detection_limit)}" for axis in each.axes),
        "; ".join(map(_effect_text, each.effects)),
        each.samples,
        each.bag,
    ]


def _trends(found: Survey) -> picture.Picture | None:
    """Show the trends of an instrument, one that changed if any did; None where there are none."""
    series = {name: courses(some) for name, some in by_instrument(found.recordings)}
    known = {name: each for name, each in series.items() if each}
    if not known:
        return None
    ordered = sorted(known, key=lambda name: name not in found.changed)
    axes = sorted({axis for each in known.values() for axis, _ in each})
    names = [q for q in QUANTITIES if any(q == name for each in known.values() for _, name in each)]
    variants = {
        instrument: [
            [_trend(known[instrument], found, instrument, axis, name) for axis in axes]
            for name in names
        ]
        for instrument in ordered
    }
    caption = said("survey.trends")
    return picture.Picture("trends", caption, variants[ordered[0]], LOW, variants=variants)


def _instrument_row(name: str, some: Sequence[Recording], found: Survey) -> tuple[str, ...]:
    verdicts = Counter(each.verdict.replace("_", " ") for each in some if not each.error)
    counts = ", ".join(f"{verdict}: {n}" for verdict, n in verdicts.most_common())
    result = "changed" if name in found.changed else "no change"
    return name, str(len(some)), str(sum(bool(each.error) for each in some)), counts, result


def _effect_text(effect: NamedEffect) -> str:
    kind = f" ({effect.kind})" if effect.kind else ""
    values = ", ".join(f"{each.name} {_value_text(each)}" for each in effect.values)
    return f"{effect.name}{kind} of {effect.axis}: {values}"


def _value_text(value: EffectValue) -> str:
    if value.low is None or value.high is None:
        return quantity(value.value, np.inf, value.unit)
    return quantity(value.value, 0.5 * (value.high - value.low), value.unit)


def _what(change: Change) -> str:
    return said(f"quantity.{change.name}", axis=change.axis)


def _factor(change: Change) -> str:
    step, half = change.point.step, change.point.halfwidth
    digits = max(3, 1 - int(np.floor(np.log10(max(half, 1e-6)))))
    ends = (significant(float(np.exp(step + side)), digits) for side in (0.0, -half, half))
    return "{} ({} to {})".format(*ends)


def _time(stamp: int) -> str:
    return f"{datetime.fromtimestamp(1e-9 * stamp, UTC):%Y-%m-%d %H:%M}" if stamp else UNSTATED


def _trend(
    series: dict[tuple[str, str], Course], found: Survey, instrument: str, axis: str, name: str
) -> picture.Panel:
    """Show a quantity of an axis of an instrument over time; nothing where it is not determined."""
    course = series.get((axis, name), [])
    times = _dates(*(recording.recorded for recording, _ in course))
    values = np.array([estimate.value for _, estimate in course])
    whole = np.array([estimate.interval for _, estimate in course]).reshape(-1, 2)
    noise = np.exp(1.96 * np.array([estimate.noise for _, estimate in course]))
    changed = [
        _dates(each.after, each.before)
        for each in found.changed.get(instrument, [])
        if (each.axis, each.name) == (axis, name)
    ]
    marks: list[picture.Mark] = [
        picture.Stretches(changed, "", picture.ORANGE),
        picture.Bars(times, whole[:, 0], whole[:, 1], "", picture.LIGHT_BLUE),
        picture.Bars(times, values / noise, values * noise, "", picture.BLUE, 2.0),
        picture.Curve(times, values, "", picture.BLUE, dots=True),
    ]
    over = "over its limit" if name == RESIDUAL else "over the model's"
    title = said(f"quantity.{name}", axis=axis)
    return picture.Panel(marks, "time", over, title, level=1.0, dates=True)


def _dates(*stamps: int) -> NDArray[np.datetime64]:
    return np.array(stamps, dtype="datetime64[ns]")
