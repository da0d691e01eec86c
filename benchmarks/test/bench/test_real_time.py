"""The benches of real time run: a converter's clock, and viewers that fall out."""

import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("rclpy")

from afm_scan_bench.faults import drive, real_time, viewers
from afm_scan_bench.faults.injection import clocked_scanner, trial
from afm_scan_bench.faults.injection.clocked_scanner import ClockedScanner
from afm_scan_bench.faults.injection.drive import DriveOutcome
from afm_scan_bench.faults.injection.processes import NODES
from afm_scan_bench.faults.injection.trial import Heard
from afm_scan_ros.core.errors import ScanError
from afm_scan_ros.core.types import Trace
from afm_scan_ros.drivers import load_settings

PERIOD = 1e-3
SENT = 50
"""Samples of a block."""


class Clock:
    """A clock that only the test and sleeping move."""

    def __init__(self) -> None:
        self.now = 5.0

    def sleep(self, seconds: float) -> None:
        self.now += seconds

    def module(self) -> SimpleNamespace:
        return SimpleNamespace(monotonic=lambda: self.now, sleep=self.sleep)


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    clock = Clock()
    monkeypatch.setattr(clocked_scanner, "time", clock.module())
    return clock


@pytest.fixture
def scanner(tmp_path: Path) -> ClockedScanner:
    """Return a scanner with a buffer of 100 samples, 0.1 s."""
    file = tmp_path / "settings.yaml"
    text = real_time.SETTINGS.replace("latency_samples: 10000", "latency_samples: 100")
    file.write_text(text.replace("{report}", "none"), "utf-8")
    made = ClockedScanner(load_settings("any", file).settings, str(tmp_path / "report.json"))
    made.start(PERIOD)
    return made


def block(number: int) -> Trace:
    return Trace(number * SENT, PERIOD, np.zeros(SENT), np.zeros(SENT))


def test_a_reading_comes_when_its_sample_has_been_taken(
    clock: Clock, scanner: ClockedScanner, tmp_path: Path
) -> None:
    began = clock.now
    read = [scanner.advance(block(number)).sensor.x for number in range(3)]
    assert clock.now == pytest.approx(began + 3 * SENT * PERIOD)
    assert not np.any(np.concatenate(read[:2]))  # of before the drive
    assert np.any(read[2])  # noise
    clock.now += 0.06
    scanner.advance(block(3))
    scanner.ramp_down()
    said = json.loads((tmp_path / "report.json").read_text("utf-8"))
    assert said["least_s"] == pytest.approx(0.04)
    assert said["first_output"] == pytest.approx(began + 0.1)


def test_a_block_that_comes_late_is_an_underrun(clock: Clock, scanner: ClockedScanner) -> None:
    scanner.advance(block(0))
    clock.now += 0.11
    with pytest.raises(ScanError, match=r"sample 50 was not output in time \(underrun\).* 0.010 s"):
        scanner.advance(block(1))


def test_a_scan_on_the_clock_is_whole_or_says_why(tmp_path: Path) -> None:
    found = real_time.scan(tmp_path / "scan", 0.5)
    if found["ended"] == "whole":
        assert (found["underruns"], found["gaps"]) == (0, 0)
        assert 0.0 < found["least_ms"] <= found["buffer_ms"]
    else:  # the machine was too slow for real time
        assert "underrun" in found["ended"] or "silent" in found["ended"]


@pytest.mark.parametrize("kind", viewers.SIGNALS)
def test_a_viewer_costs_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: str) -> None:
    patient = {name: {**trial.FLOW.get(name, {}), **trial.PATIENT[name]} for name in NODES}
    monkeypatch.setattr(trial, "FLOW", patient)  # a writer that blocks does so for longer
    monkeypatch.setattr(viewers, "DURATION", 2.0)
    monkeypatch.setattr(viewers, "LATE", trial.PATIENCE)  # the machine may be busy
    monkeypatch.setattr(viewers, "SIGNALS", {kind: viewers.SIGNALS[kind]})
    (row,) = viewers.disturb(tmp_path / "scans", 20_000, 1, lambda _: None)
    assert (row["trials"], row["whole"], row["trouble"]) == (1, 1, "")


def test_lateness_is_that_of_the_latest_node_until_it_is_done() -> None:
    heard = [
        Heard(9.0, "scan_recorder", "ready", 0, ""),
        Heard(10.0, NODES[0], "running", 0, ""),
        Heard(11.0, NODES[0], "running", 100, ""),
        Heard(11.5, "scan_recorder", "running", 80, ""),
        Heard(13.0, NODES[0], "done", 200, ""),
        Heard(99.0, NODES[0], "done", 200, ""),
    ]
    assert viewers.lateness(heard, 0.01) == pytest.approx(1.0)
    assert viewers.lateness(heard[:1], 0.01) == 0.0


def test_a_row_counts_what_was_in_time_and_named() -> None:
    done = [
        DriveOutcome(0.4, 4.0, named=True),
        DriveOutcome(0.6, 3.0, broken=["a"]),
        DriveOutcome(),
    ]
    row = drive.row("any", done)
    assert (row["trials"], row["in_time"], row["named"], row["trouble"]) == (3, 1, 1, "a")
    json.dumps(row)
