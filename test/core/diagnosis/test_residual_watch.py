"""One noisy line is no alarm, and one quiet line does not end it."""

import re

from hypothesis import given
from hypothesis import strategies as st

from afm_scan_ros.core.diagnosis.monitor import (
    ALARM_RATIO,
    CALM_RATIO,
    LINES,
    AxisResidual,
    LineResidual,
    ResidualWatch,
)

LEVELS = {
    "c": 0.9 * CALM_RATIO * ALARM_RATIO,
    "m": 0.5 * (1.0 + CALM_RATIO) * ALARM_RATIO,
    "s": 1.1 * ALARM_RATIO,
}
"""Calm, between, and suspect."""


def line(number: int, x: float, y: float) -> LineResidual:
    residuals = (
        AxisResidual(1e-7, 3e-7, normalised_residual, (10.0, 30.0))
        for normalised_residual in (x, y)
    )
    return LineResidual(number, 1000 * number, *residuals)


def expected(levels: str) -> list[bool]:
    """Return whether x is alarmed after each line: since the last ``sss`` no ``ccc`` came."""
    begun = [m.end() for m in re.finditer(rf"(?=(s{{{LINES}}}))", levels)]
    states = []
    for end in range(1, len(levels) + 1):
        seen = levels[:end]
        alarms = [b + LINES for b in begun if b + LINES <= end]
        calms = [m.start() + LINES for m in re.finditer(rf"(?=(c{{{LINES}}}))", seen)]
        states.append(bool(alarms) and max(alarms) > max(calms, default=0))
    return states


@given(st.text(alphabet="cms", min_size=1, max_size=30))
def test_an_alarm_takes_lines_in_a_row_to_begin_and_to_end(levels: str) -> None:
    watch = ResidualWatch()
    states, news = [], []
    for number, level in enumerate(levels):
        news += watch.news(line(number, LEVELS[level], 1.0))
        states.append(watch.alarm.startswith("x: "))
    assert states == expected(levels)
    changes = [now != before for now, before in zip(states, [False, *states], strict=False)]
    assert len(news) == sum(changes)


def test_axes_are_told_apart_and_both_stand_in_the_alarm() -> None:
    watch = ResidualWatch(suspect=10.0, lines=1)
    assert watch.news(line(0, 1.0, 11.0)) == [watch.alarm]
    assert watch.alarm == (
        "y: by line 0 the residual, 100 nm rms, is 11 times the model discrepancy between 10 and"
        " 30 Hz: diagnose this scan's bag"
    )
    watch.news(line(1, 20.0, 9.0))
    assert [part[:2] for part in watch.alarm.split("; ")] == ["x:", "y:"]
    assert watch.news(line(2, 20.0, 7.0)) == [
        "y: by line 2 the residual is within the model discrepancy again"
    ]
    assert watch.alarm.startswith("x: by line 1 ")
