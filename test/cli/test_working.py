"""What a long computation is at is reported outside a terminal too, and does not flood a log."""

import pytest

from afm_scan_ros.cli.options import EVERY, in_lines, working
from afm_scan_ros.core.types import Step


def test_a_log_hears_when_it_begins(capsys: pytest.CaptureFixture[str]) -> None:
    with working("diagnosing") as report:
        assert capsys.readouterr().err == ""
        report("x: delay")
        report("x: drift")
    message = capsys.readouterr()
    assert (message.err, message.out) == ("diagnosing: x: delay (0 s)\n", "")


def test_a_log_hears_now_and_then(capsys: pytest.CaptureFixture[str]) -> None:
    """A step a second for ten minutes, as in a long record."""
    seconds = iter(range(601))
    report = in_lines("diagnosing", lambda: float(next(seconds)))
    for step in range(600):
        report(f"step {step}")
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 600 / EVERY
    assert lines[1] == "diagnosing: step 20 (21 s)"


def test_a_log_hears_nothing_of_what_is_over_soon(capsys: pytest.CaptureFixture[str]) -> None:
    """A step a second for a minute, where the first line is not to come at once."""
    seconds = iter(range(61))
    report = in_lines("diagnosing", lambda: float(next(seconds)), at_once=False)
    for step in range(int(EVERY) - 1):
        report(f"step {step}")
    assert capsys.readouterr().err == ""
    for step in range(int(EVERY) - 1, 60):
        report(f"step {step}")
    assert capsys.readouterr().err.splitlines()[0] == "diagnosing: step 19 (20 s)"


def test_a_log_hears_how_long_what_is_counted_still_takes(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """A part takes ten seconds, whatever the number of parts."""
    moments = iter([0.0, 0.0, 40.0, 70.0])
    report = in_lines("surveying", lambda: next(moments))
    for done in (0, 4, 7):
        report(Step(f"bag {done}", done, 10))
    assert capsys.readouterr().err.splitlines() == [
        "surveying: bag 0 (0 s)",
        "surveying: bag 4 (40 s, about 60 s left)",
        "surveying: bag 7 (70 s, about 30 s left)",
    ]


def test_a_terminal_sees_how_long_what_is_counted_still_takes(
    capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("COLUMNS", "200")
    moments = iter([0.0, 5.0])
    monkeypatch.setattr("afm_scan_ros.cli.options.monotonic", lambda: next(moments))
    with working("surveying") as report:
        report(Step("one bag", 1, 4))
    assert "surveying: one bag, about 15 s left" in capfd.readouterr().err
