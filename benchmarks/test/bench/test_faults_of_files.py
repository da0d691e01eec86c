"""Files that are damaged or mistaken are refused by name or read as written: a short trial."""

import time

import pytest

pytest.importorskip("rclpy")

from afm_scan_bench.faults.injection import damaged_bags as faults_damaged_bags
from afm_scan_bench.faults.injection import fuzzed_readers as faults_fuzzed_readers
from afm_scan_bench.faults.injection import mutated_files as faults_mutated_files
from afm_scan_bench.faults.injection import outcome as faults_outcome
from afm_scan_bench.faults.injection import stated_sizes as faults_stated_sizes
from afm_scan_bench.faults.injection.outcome import Tally
from afm_scan_bench.faults.injection.readings import LossError, refuse_other
from afm_scan_ros.core.errors import InputError, ScanError


def test_nothing_is_lost_by_damage_to_bags() -> None:
    rows = list(faults_damaged_bags.inject(lambda _: None, trials=40))
    assert [row["losses"] for row in rows] == [0] * 5, rows
    assert sum(int(row["trials"]) for row in rows) == 40


def test_nothing_is_lost_by_mistakes_in_files() -> None:
    rows = list(faults_mutated_files.inject(lambda _: None, trials=90))
    assert [row["losses"] for row in rows] == [0] * 5, rows


def test_every_reader_reads_or_refuses_whatever_is_damaged() -> None:
    rows = list(faults_fuzzed_readers.inject(lambda _: None, trials=340))
    assert [row["losses"] for row in rows] == [0] * len(faults_fuzzed_readers.READERS), rows


def refused(message: str) -> None:
    raise InputError(message)


def failed(message: str) -> None:
    raise ScanError(message)


@pytest.mark.parametrize(
    ("trial", "losses"),
    [
        (lambda: refused("here: a line"), 0),
        (lambda: refused("a line without its place"), 1),
        (lambda: failed("here:\ntwo lines"), 1),
        (lambda: {}["key"], 1),
        (lambda: time.sleep(3) or "at last", 1),
        (lambda: "the same", 0),
    ],
)
def test_a_loss_is_counted(monkeypatch: pytest.MonkeyPatch, trial: object, losses: int) -> None:
    monkeypatch.setattr(faults_outcome, "PATIENCE", 1)
    tally = Tally()
    tally.judge(trial, "here")
    assert tally.row("any")["losses"] == losses


@pytest.mark.parametrize(
    ("written", "read"),
    [
        ({"a": "1.0"}, {"a": 1.1}),
        ({"a": "017"}, {"a": 17}),
        ({"a": "off"}, {"a": True}),
        ({"a": "word"}, {"a": "other"}),
        ({"a": "1"}, {}),
        ({"a": ["1.0", "2.0"]}, {"a": (1.0,)}),
        ({"a": {"b": "1"}}, {"a": {"b": 2}}),
    ],
)
def test_another_reading_than_the_file_is_a_loss(written: object, read: object) -> None:
    with pytest.raises(LossError):
        refuse_other(written, read)


def test_no_memory_is_taken_for_what_is_only_stated() -> None:
    (row,) = faults_stated_sizes.inject(lambda _: None, trials=1)
    assert row["losses"] == 0, row
    assert row["trials"] == len(faults_stated_sizes.HOSTILE)
