"""A node killed (SIGKILL) at a random moment of a scan."""

import signal
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory

import numpy as np
from attrs import define, field

from afm_scan_bench.faults.faults import Announce, row
from afm_scan_bench.faults.injection.bag import Undisturbed
from afm_scan_bench.faults.injection.processes import INCOMPLETE, NODES
from afm_scan_bench.faults.injection.trial import BLOCK, Trial, numbered, undisturbed
from afm_scan_ros.bag.writer import CHUNK_BYTES
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.nodes.peers import FAILED
from afm_scan_ros.report.table import Row

TRIALS = 50
DEADLINE = 1.0
"""Seconds within which every other node has reported what is missing."""
SCANNER, RECORDER = "piezoscanner_sim", "scan_recorder"
_LONGEST = 2.0
_BYTES = 16
"""Of a sample of one topic."""


@define
class Killed:
    """What followed, in s after the kill and in samples; ``broken`` are promises, as text.

    ``reported_after`` alone shows that something was reported too late.
    """

    victim: str
    reported_after: float = float("nan")
    ended: float = float("nan")
    unfinished: int = 0
    broken: list[str] = field(factory=list)


def inject(announce: Announce, trials: int = TRIALS) -> Iterator[Row]:
    """Kill each node in turn, at moments drawn from the trial's number."""
    with TemporaryDirectory() as folder:
        calm = undisturbed(Path(folder))
        killed = numbered(announce, "kills", trials, folder)
        done = [kill(where, number, calm) for number, where in killed]
    for victim in NODES:
        yield _row(victim, [each for each in done if each.victim == victim])


def kill(folder: Path, number: int, calm: Undisturbed) -> Killed:
    """Kill one node of one scan, and see what becomes of the others and of the bag."""
    done = Killed(NODES[number % len(NODES)])
    moment = float(np.random.default_rng(number).uniform(0.0, _LONGEST))
    with Trial(folder) as trial:
        trial.start(*NODES)
        if not trial.until_running():
            done.broken.append("the scan did not begin")
            return done
        trial.listen(moment)
        trial.nodes[done.victim].send(signal.SIGKILL)
        killed = time.monotonic()
        if not trial.until_ended():
            done.broken.append("hung")
        done.ended = time.monotonic() - killed
        _judge_words(trial, killed, done)
        _judge_bag(trial, calm, done)
    return done


def _judge_words(trial: Trial, killed: float, done: Killed) -> None:
    others = [name for name in trial.nodes if name != done.victim]
    failed = {each.node: each for each in reversed(trial.heard) if each.state == FAILED}
    moments = []
    for name in others:
        if trial.nodes[name].status != INCOMPLETE:
            done.broken.append(f"{name} ended with status {trial.nodes[name].status}")
        if name not in failed or done.victim not in failed[name].reason:
            done.broken.append(f"{name} did not report {done.victim}, but {failed.get(name)}")
        else:
            moments.append(failed[name].moment - killed)
    done.reported_after = max(moments, default=done.reported_after)
    if done.victim != SCANNER and "drive ramped down to 0 V" not in trial.nodes[SCANNER].message:
        done.broken.append("the drive was not ramped down")


def _judge_bag(trial: Trial, calm: Undisturbed, done: Killed) -> None:
    """See that a bag has all that its recorder reported, but for an unfinished chunk."""
    had = max((each.next_sample for each in trial.heard if each.node == RECORDER), default=0)
    try:
        done.unfinished = max(0, had - calm.kept(trial.bag))
    except InputError as error:
        done.broken.append(str(error))
        return
    chunk = CHUNK_BYTES // _BYTES + BLOCK
    if done.unfinished > (chunk if done.victim == RECORDER else 0):
        done.broken.append(f"{done.unfinished} samples that were recorded are missing")
    if done.victim != RECORDER and not (trial.bag / "metadata.yaml").is_file():
        done.broken.append("the bag was not closed")


def _row(victim: str, done: Sequence[Killed]) -> Row:
    reported, ended = [each.reported_after for each in done], [each.ended for each in done]
    figures = (
        f"reported within {median(reported):.2f} s, worst {max(reported):.2f}; all ended"
        f" within {max(ended):.2f} s;"
        f" {max(each.unfinished for each in done)} samples unfinished at most"
    )
    broken = ["; ".join(each.broken) for each in done if each.broken]
    broken += [
        "reported too late" for each in done if each.reported_after > DEADLINE and not each.broken
    ]
    return row(f"{victim} killed", len(done), broken, figures)
