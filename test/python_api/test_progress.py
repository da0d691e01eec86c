"""What is left is told from the parts that are over, and from nothing else."""

import pytest
from attrs import define

import afm_scan_ros as afm
from afm_scan_ros.core.types import Step, Tally
from afm_scan_ros.progress import Stopwatch


@define
class Clock:
    now: float = 0.0

    def __call__(self) -> float:
        return self.now


def told(*heard: tuple[float, str]) -> list[str]:
    """What a stopwatch says when it hears each step at its time."""
    clock, said = Clock(), []
    watch = Stopwatch(clock)
    for clock.now, doing in heard:
        watch.hear(doing)
        said.append(str(watch))
    return said


def test_nothing_is_left_of_what_is_not_counted() -> None:
    assert told((0.0, "looking"), (90.0, "fitting")) == ["0 s", "90 s"]


def test_the_second_axis_takes_as_long_as_the_first() -> None:
    first = [(5.0, Step("x: modes", 0, 2)), (40.0, Step("x: plays", 0, 2))]
    second = [(65.0, Step("y: modes", 1, 2)), (95.0, Step("y: plays", 1, 2))]
    overdue = [(126.0, Step("y: validating", 1, 2)), (130.0, "writing the report")]
    assert told(*first, *second, *overdue) == [
        *("5 s", "40 s", "65 s, about 60 s left", "95 s, about 30 s left", "126 s", "130 s"),
    ]


def test_what_may_grow_is_a_lower_bound() -> None:
    steps = [(0.0, Step("a", 0, 4, more=True)), (10.0, Step("b", 2, 6, more=True))]
    assert told(*steps) == ["0 s", "10 s, at least 20 s left"]


def test_a_count_that_begins_anew_is_of_other_parts() -> None:
    steps = [(0.0, Step("a", 0, 2)), (10.0, Step("b", 1, 2)), (20.0, Step("c", 0, 3))]
    assert told(*steps, (24.0, Step("d", 1, 3)))[2:] == ["20 s", "24 s, about 8 s left"]


def test_parts_named_apart_are_counted_together() -> None:
    heard: list[Step] = []
    whole = Tally(heard.append)  # type: ignore[arg-type]
    x, y = whole.named("x: "), whole.named("y: ")
    x.plan(3)
    y.plan(2)
    x.begin("trying delay")
    y.begin("trying drift", 2)
    x.plan(-1)
    x.begin("fitting delay")
    assert [(step, step.done, step.total, step.more) for step in heard] == [
        ("x: trying delay", 0, 5, True),
        ("y: trying drift", 1, 5, True),
        ("x: fitting delay", 3, 4, True),
    ]


def test_a_callback_shows_the_time_beside_what_is_done(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    clock, shown = Clock(), []
    monkeypatch.setattr("afm_scan_ros.progress.Stopwatch", lambda: Stopwatch(clock))
    report = afm.timed(shown.append)
    report("x: modes")
    clock.now = 12.4
    report(Step("x: plays", 1, 3))
    assert shown == ["x: modes (0 s)", "x: plays (12 s, about 25 s left)"]
