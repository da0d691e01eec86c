"""What a long computation is at is reported outside a terminal too, and does not flood a log."""

import time

import pytest

from afm_scan_ros.cli import progress
from afm_scan_ros.cli.progress import EVERY, Lines, working
from afm_scan_ros.core.types import Step
from afm_scan_ros.progress import Stopwatch


class Clock:
    """A clock that is set."""

    def __init__(self) -> None:
        self.now = 0.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def clock() -> Clock:
    return Clock()


def test_a_log_hears_when_it_begins(capsys: pytest.CaptureFixture[str]) -> None:
    with working("diagnosing") as report:
        assert capsys.readouterr().err == ""
        report("x: delay")
        report("x: drift")
    message = capsys.readouterr()
    assert (message.err, message.out) == ("diagnosing: x: delay (0 s)\n", "")


def test_a_log_hears_now_and_then(capsys: pytest.CaptureFixture[str], clock: Clock) -> None:
    """A step a second for ten minutes, as in a long record."""
    report = Lines("diagnosing", watch=Stopwatch(clock))
    for step in range(600):
        clock.now = step
        report(f"step {step}")
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 600 / EVERY
    assert lines[1] == "diagnosing: step 20 (20 s)"


def test_a_log_hears_nothing_of_what_is_over_soon(
    capsys: pytest.CaptureFixture[str], clock: Clock
) -> None:
    """A step a second for a minute, where the first line is not to come at once."""
    report = Lines("diagnosing", EVERY, Stopwatch(clock))
    for step in range(60):
        clock.now = step
        report(f"step {step}")
        assert (capsys.readouterr().err != "") == (step in {20, 40})


def test_a_log_hears_of_a_step_that_lasts(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(progress, "EVERY", 0.05)
    with working("identifying", at_once=False) as report:
        report("x: looking for modes")
        lines: list[str] = []
        while len(lines) < 2:
            time.sleep(0.01)
            lines += capsys.readouterr().err.splitlines()
    assert all(line.startswith("identifying: x: looking for modes (") for line in lines)


def test_a_log_hears_how_long_what_is_counted_still_takes(
    capsys: pytest.CaptureFixture[str], clock: Clock
) -> None:
    """A part takes ten seconds, whatever the number of parts."""
    report = Lines("surveying", watch=Stopwatch(clock))
    for done in (0, 4, 7):
        clock.now = 10.0 * done
        report(Step(f"bag {done}", done, 10))
    assert capsys.readouterr().err.splitlines() == [
        "surveying: bag 0 (0 s)",
        "surveying: bag 4 (40 s, about 60 s left)",
        "surveying: bag 7 (70 s, about 30 s left)",
    ]


def test_a_terminal_sees_how_long_what_is_counted_still_takes(
    capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, clock: Clock
) -> None:
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("COLUMNS", "200")
    monkeypatch.setattr(progress, "Stopwatch", lambda: Stopwatch(clock))
    with working("surveying") as report:
        clock.now = 5.0
        report(Step("one bag", 1, 4))
        clock.now = 7.0
    shown = capfd.readouterr().err
    assert "surveying: one bag" in shown
    assert "(7 s, about 13 s left)" in shown
