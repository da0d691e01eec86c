"""A viewer of every topic that is killed, stopped or blocked while the scan runs in real time.

The viewer has ROS's own settings of DDS, the nodes those that they set themselves.
"""

import shutil
import signal
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from attrs import frozen

from afm_scan_bench.faults.faults import Announce
from afm_scan_bench.faults.injection import viewer
from afm_scan_bench.faults.injection.bag import Undisturbed
from afm_scan_bench.faults.injection.processes import NODES
from afm_scan_bench.faults.injection.trial import Heard, Trial, numbered, undisturbed
from afm_scan_bench.faults.machine import load
from afm_scan_ros.cli.progress import working
from afm_scan_ros.nodes.peers import DONE, RUNNING
from afm_scan_ros.report.table import Row, Table

TRIALS = 20
"""At each rate, of each of the three."""
RATES = (20_000, 100_000, 200_000)
LINE_RATE = 20.0
LATE = 2.0
"""Longest lateness, s, of any node of a scan against its pace."""
DURATION = 28.0
"""Seconds: Fast DDS counts a killed or stopped reader for twenty, and then forgets it."""
SIGNALS = {"killed": signal.SIGKILL, "stopped": signal.SIGSTOP, "blocked": viewer.BLOCK}
_LATEST = 5.0

COLUMNS = {
    "rate_khz": ("rate, kHz", "g"),
    "viewer": ("viewer", ""),
    "trials": ("trials", "d"),
    "whole": (f"whole scans, never more than {LATE:g} s late", "d"),
    "late_s": ("largest lateness, s", ".2f"),
    "samples": ("samples a scan", ",d"),
    "trouble": ("what was wrong", ""),
}


@frozen
class Seen:
    """What became of one scan: its largest lateness (s), and what was wrong, if anything."""

    late: float
    trouble: str


def measure(trials: int = TRIALS) -> Table:
    """Disturb so many scans at each rate in each way."""
    with working("viewers") as announce, TemporaryDirectory() as folder:
        rows = [
            row
            for rate in RATES
            for row in disturb(Path(folder) / str(rate), rate, trials, announce)
        ]
    title = f"A viewer killed, stopped or blocked within a scan of {DURATION:g} s ({load()})"
    return Table("viewers", title, COLUMNS, rows)


def disturb(folder: Path, rate: int, trials: int, announce: Announce) -> Iterator[Row]:
    """Let a viewer fall out in each way at a rate (Hz), at moments drawn from the trial's number.

    Yields a row for each way. Raises ScanError where the undisturbed scan does not end well.
    """
    spec = _scan(rate)
    folder.mkdir()
    calm = undisturbed(folder, spec)
    for kind, number in SIGNALS.items():
        fault = f"a viewer at {rate // 1000} kHz that is {kind}"
        scans = numbered(announce, fault, trials, str(folder))
        seen = [view(place, trial, number, spec, calm) for trial, place in scans]
        troubles = [f"{trial}: {each.trouble}" for trial, each in enumerate(seen) if each.trouble]
        yield {
            "rate_khz": rate / 1000,
            "viewer": kind,
            "trials": trials,
            "whole": trials - len(troubles),
            "late_s": max(each.late for each in seen),
            "samples": calm.total_samples,
            "trouble": "; ".join(troubles),
        }


def view(
    folder: Path,
    trial: int,
    number: signal.Signals,
    spec: Mapping[str, object],
    calm: Undisturbed,
) -> Seen:
    """Make one scan with a viewer, which is no part of it; say what it cost, if anything.

    The bag is removed where it is whole.
    """
    moment = float(np.random.default_rng(trial).uniform(0.0, _LATEST))
    with Trial(folder, **{NODES[0]: spec}) as scan:
        seer = scan.start_viewer()
        scan.start(*NODES)
        scan.until_running()
        scan.listen(moment)
        seer.send(number)
        ended = scan.until_ended()
        late = lateness(scan.heard, calm.sample_period)
        if set(scan.statuses().values()) != {0}:
            texts = [node.message.strip() for node in scan.nodes.values() if node.status]
            return Seen(late, "; ".join(texts) if ended else "hung")
        missing = calm.missing(scan.bag)
    if not missing:
        shutil.rmtree(folder)
    return Seen(late, missing or (f"{late:.1f} s late" if late > LATE else ""))


def lateness(heard: Sequence[Heard], period: float) -> float:
    """Return by how much (s) the node that was latest was behind the pace of the source, at worst.

    ``period`` is that of the samples (s). A node counts from when the source runs until it is done.
    """
    running = [each for each in heard if each.state == RUNNING]
    start = next((each.moment for each in running if each.node == NODES[0]), None)
    if start is None:
        return 0.0
    done: dict[str, Heard] = {}
    for each in heard:
        if each.state == DONE:
            done.setdefault(each.node, each)
    reports = [*running, *done.values()]
    return max(each.moment - start - each.next_sample * period for each in reports)


def _scan(rate: int) -> Mapping[str, object]:
    """Return the scan at a sample rate (Hz), in blocks of the size that nobody states."""
    return {
        "line_rate_hz": LINE_RATE,
        "lines": round(DURATION * LINE_RATE),
        "samples_per_line": round(rate / LINE_RATE),
        "block_size": 0,
        "window": 0,
    }
