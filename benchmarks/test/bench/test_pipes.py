"""The benches of processes and files run and give their rows, at sizes of no significance."""

import subprocess
import sys

import pytest

pytest.importorskip("rclpy")

from afm_scan_bench.speed import bags, memory, pipes, startup
from afm_scan_bench.speed.timing.ratios import by_turns, row
from afm_scan_ros.core.errors import ScanError


def test_a_ratio_is_taken_within_each_turn() -> None:
    ours, theirs = iter([9.0, 1.0, 4.0, 3.0]), iter([9.0, 1.0, 2.0, 1.0])
    measured = by_turns(3, lambda: next(ours), lambda: next(theirs))
    found = row("a", "b", "s", "≤ 1", *measured)
    assert [found[key] for key in ("ratio", "lowest", "highest")] == [2.0, 1.0, 3.0]
    assert (found["ours"], found["theirs"]) == (3.0, 1.0)


def test_blocks_go_through_nodes_and_through_the_binding_alone() -> None:
    (found,) = pipes.table({1000: 30}, turns=1).rows
    assert found["real_time"] == pytest.approx(found["blocks_per_s"] / 100)
    assert found["share"] == pytest.approx(found["blocks_per_s"] / found["plain_per_s"])


def test_a_part_that_dies_ends_the_race(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        pipes, "START", "import sys, time; {0!r} == 'source' and sys.exit(1); time.sleep(60)"
    )
    with pytest.raises(ScanError, match="'source': 1"):
        pipes.plain_rate(1000, 30)


def test_bags_are_raced_against_the_libraries() -> None:
    rows = bags.table(blocks=5, decoded=2, turns=1).rows
    assert [found["target"] for found in rows] == ["≥ 0.7", "≥ 0.7", "≥ 0.5", "", "≥ 10"]
    assert all(found["ratio"] > 0 for found in rows)


def test_each_start_is_measured(monkeypatch: pytest.MonkeyPatch) -> None:
    started = []
    monkeypatch.setattr(
        startup.subprocess, "run", lambda arguments, **_: started.append(arguments[-1])
    )
    assert [found["target"] for found in startup.table(turns=1).rows] == ["≤ 5", "≤ 1.3", "≤ 1.3"]
    assert started[:3] == ["--help", "pass", "import numpy, scipy.signal"]
    assert "afm_scan_ros.core.effects.creep" in started[4]


def test_the_memory_of_a_process_is_seen() -> None:
    code = "import time; held = b'.' * 200_000_000; time.sleep(0.3)"
    with memory.watched() as peaks:
        subprocess.run([sys.executable, "-c", code, "analyze"], check=True)
    assert 200 < peaks["analyze"] < 300
