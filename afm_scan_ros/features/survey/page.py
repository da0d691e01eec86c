"""The report on a survey: sentences, rows, figures and the page."""

from collections import Counter
from collections.abc import Iterator, Sequence
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
from attrs import frozen
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from afm_scan_ros.features.survey.changes import Change, Course, by_instrument, courses
from afm_scan_ros.features.survey.recording import EffectValue, NamedEffect, Recording
from afm_scan_ros.report import html
from afm_scan_ros.report.provenance import UNSTATED
from afm_scan_ros.report.quantity import quantity, significant
from afm_scan_ros.report.style import BLUE, GREY, LIGHT_BLUE, ORANGE, blank, styled
from afm_scan_ros.report.table import Part, Rows

NANO = 1e-9
QUANTITIES = {
    "gain": "gain of {}",
    "resonance": "first resonance of {}",
    "damping": "damping ratio of {}",
    "creep": "creep of {}",
    "residual_ratio": "residual of {} over its detection limit",
}
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


def alert(changes: Sequence[Change]) -> str:
    """Say in a line what changed of an instrument, the surest change first."""
    first, *others = changes
    also = f"; also {', '.join(map(_what, others))}" if others else ""
    named = f"; diagnosis: {', '.join(first.effects)}" if first.effects else ""
    when = f"between {_time(first.after)} and {_time(first.before)}"
    return (
        f"alert: {first.instrument}: {_what(first)} changed by a factor of {_factor(first)},"
        f" {when}{also}{named}"
    )


def summary(found: Survey) -> Iterator[Part]:
    """Yield what was surveyed, and an alert for each instrument that changed."""
    instruments = list(by_instrument(found.recordings))
    rows = [_instrument_row(name, some, found) for name, some in instruments]
    yield Rows(SURVEYED, rows)
    for each in found.failed:
        yield f"{each.bag} was not diagnosed: {each.error}"
    for each in found.recordings:
        if not each.error and not each.recorded:
            yield f"{each.bag} states no time, so no trend has it"
    yield from map(alert, found.changed.values())


def page(found: Survey, now: datetime) -> str:
    """Return the report as a self-contained HTML page."""
    instruments = [
        {
            "name": name,
            "trends": _trends(some, found.changed.get(name, [])),
            "recordings": sorted(some, key=lambda each: (each.recorded, each.bag)),
            "models": sorted({each.model for each in some}),
        }
        for name, some in by_instrument(found.recordings)
    ]
    return html.page(
        "survey.html",
        Path(__file__).parent / "templates",
        summary=summary(found),
        changes=found.changes,
        false_alarm=found.false_alarm,
        instruments=instruments,
        written=now,
        versions=sorted({each.version for each in found.recordings}),
        what=_what,
        factor=_factor,
        time=_time,
        effect=_effect_text,
    )


def _trends(recordings: Sequence[Recording], changes: Sequence[Change]) -> bytes | None:
    """Draw the trends of an instrument; None where it has none."""
    series = courses(recordings)
    return html.png(_figure(series, changes)) if series else None


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
    return QUANTITIES[change.name].format(change.axis)


def _factor(change: Change) -> str:
    step, half = change.point.step, change.point.halfwidth
    digits = max(3, 1 - int(np.floor(np.log10(max(half, 1e-6)))))
    ends = (significant(float(np.exp(step + side)), digits) for side in (0.0, -half, half))
    return "{} ({} to {})".format(*ends)


def _time(stamp: int) -> str:
    return f"{datetime.fromtimestamp(NANO * stamp, UTC):%Y-%m-%d %H:%M}" if stamp else UNSTATED


@styled
def _figure(series: dict[tuple[str, str], Course], changes: Sequence[Change]) -> Figure:
    """Draw a panel for each quantity, a column for each axis."""
    axes = sorted({axis for axis, _ in series})
    names = [name for name in QUANTITIES if any(key[1] == name for key in series)]
    figure = blank(4.2 * len(axes), 1.3 * len(names))
    panels = figure.subplots(len(names), len(axes), sharex=True, squeeze=False)
    for row, name in zip(panels, names, strict=True):
        for panel, axis in zip(row, axes, strict=True):
            panel.set_title(QUANTITIES[name].format(axis))
            if (axis, name) in series:
                _trend(panel, series[axis, name])
            else:
                panel.text(0.0, 0.5, "not determined", transform=panel.transAxes)
                panel.yaxis.set_visible(False)
            for each in changes:
                if (each.axis, each.name) == (axis, name):
                    panel.axvspan(*_dates(each.after, each.before), color=ORANGE, alpha=0.4, lw=0)
    for panel in panels[-1]:
        panel.xaxis_date()
    return figure


def _trend(panel: Axes, course: Course) -> None:
    times = _dates(*(recording.recorded for recording, _ in course))
    values = np.array([estimate.value for _, estimate in course])
    whole = np.array([estimate.interval for _, estimate in course])
    noise = np.exp(1.96 * np.array([estimate.noise for _, estimate in course]))
    panel.axhline(1.0, color=GREY, lw=0.6, zorder=0)
    panel.vlines(times, *whole.T, color=LIGHT_BLUE, lw=0.8)
    panel.vlines(times, values / noise, values * noise, color=BLUE, lw=1.6)
    panel.plot(times, values, "o", color=BLUE, ms=2.5)
    panel.ticklabel_format(axis="y", useOffset=False)


def _dates(*stamps: int) -> NDArray[np.datetime64]:
    """Times as a figure's axis has them."""
    return np.array(stamps, dtype="datetime64[ns]")
