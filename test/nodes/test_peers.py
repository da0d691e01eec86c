"""What follows from what the others say."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from afm_scan_ros.nodes.peers import DONE, FAILED, READY, RUNNING, Peers, Report

NAMES = ("source", "middle", "end")


def peers(*reports: Report) -> Peers:
    made = Peers()
    made.follow(NAMES, "watcher", "now", 100.0)
    for report in reports:
        made.hear(report)
    return made


def report(node: str, state: str = RUNNING, **other: object) -> Report:
    fields = {"scan_id": "now", "next_sample": 0, "reason": "", "heard": 100.0}
    return Report(node=node, state=state, **(fields | other))  # type: ignore[arg-type]


@given(st.lists(st.integers(0, 10**12), min_size=3, max_size=3))
@settings(deadline=None)
def test_the_slowest_is_the_least_of_all(samples: list[int]) -> None:
    heard = [report(n, next_sample=s) for n, s in zip(NAMES, samples, strict=True)]
    assert peers(*heard).slowest() == min(samples)
    assert peers(*heard[:2]).slowest() == 0  # one has not said anything yet


def test_what_was_said_of_another_scan_does_not_count() -> None:
    heard = [report(n, READY, scan_id="before", next_sample=7) for n in NAMES]
    assert len(peers(*heard).lacking(READY)) == 3
    assert peers(*heard).slowest() == 0
    assert peers(report("end", FAILED, scan_id="before")).failure() is None


def test_a_failure_is_told_with_its_reason_even_before_a_scan() -> None:
    assert peers(report("end", FAILED, reason="disk full")).failure() == "end failed: disk full"
    early = report("end", FAILED, scan_id="", reason="no file")
    assert peers(early).failure() == "end failed: no file"
    assert peers(report("stranger", FAILED)).failure() is None


def test_silence_counts_from_the_last_word() -> None:
    heard = peers(report("middle", heard=103.0))
    assert heard.silence(NAMES, 103.9, 1.0) is None
    assert heard.silence(NAMES, 104.1, 1.0) == "middle has been silent for 1 s"


def test_a_node_that_was_never_heard_is_not_silent() -> None:
    """It may still start."""
    assert peers().silence(NAMES, 1e6, 1.0) is None


@given(st.lists(st.floats(0.0, 200.0), max_size=3), st.floats(0.0, 200.0))
@settings(deadline=None)
def test_unheard_are_those_without_a_later_word(heard: list[float], moment: float) -> None:
    made = peers(*(report(n, heard=h) for n, h in zip(NAMES, heard, strict=False)))
    later = [n for n, h in zip(NAMES, heard, strict=False) if h > moment]
    assert made.unheard_since(moment) == [n for n in NAMES if n not in later]


def test_those_who_lack_are_described() -> None:
    waiting = report("middle", READY, scan_id="", reason="waits for 2 readers")
    lacking = peers(report("source", DONE), waiting).lacking(DONE)
    assert lacking == ["middle (waits for 2 readers)", "end (no state received)"]


def test_silence_counts_from_when_one_listens() -> None:
    """A node that was busy for long has the others' heartbeats still unread."""
    made = peers(*(report(name) for name in NAMES))
    made.listen_anew(105.0)
    assert made.silence(NAMES, 105.5, 1.0) is None
    assert made.silence(NAMES, 106.5, 1.0) is not None


@pytest.mark.parametrize("state", [RUNNING, DONE])
def test_a_node_that_starts_anew_has_failed(state: str) -> None:
    """Its heartbeats would else hold a scan up for ever that it knows nothing of."""
    made = peers(report("middle", state, next_sample=500), report("middle", READY, scan_id=""))
    assert made.failure() == "middle failed: restarted, or another scan began in this ROS domain"
    made.hear(report("middle", READY))
    assert made.failure() == "middle failed: restarted, or another scan began in this ROS domain"


def test_progress_that_goes_back_is_another_node_s_of_the_same_name() -> None:
    """Started a second time, it may fail because it came late before it says anything else."""
    late = report("middle", FAILED, reason="samples 0 to 499 are missing")
    made = peers(report("middle", next_sample=500), late)
    assert made.failure() == "middle failed: restarted, or another scan began in this ROS domain"


def test_a_failure_stands_whatever_another_of_the_same_name_goes_on_to_say() -> None:
    """The others look at it ten times a second; the other reports more often."""
    late = report("middle", FAILED, reason="samples 0 to 499 are missing")
    made = peers(report("middle", next_sample=500), late, report("middle", next_sample=600))
    assert made.failure() == "middle failed: restarted, or another scan began in this ROS domain"
    made.hear(late)
    made.hear(report("middle", DONE, next_sample=700))
    assert made.failure() == "middle failed: restarted, or another scan began in this ROS domain"


def test_a_node_that_starts_anew_before_the_scan_is_welcome() -> None:
    made = peers(report("middle", READY), report("middle", READY, scan_id=""))
    assert made.failure() is None
    assert made.state("middle") is None
