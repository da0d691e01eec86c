"""One more reader of every topic, killed or stopped while the scan runs in real time.

DDS has ROS's own settings, but for those that the nodes add.
"""

import os
import shutil
import signal
from collections.abc import Iterator, Mapping
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from afm_scan_bench.faults.faults import Announce
from afm_scan_bench.faults.injection.bag import Undisturbed
from afm_scan_bench.faults.injection.processes import NODES
from afm_scan_bench.faults.injection.trial import Trial, numbered, undisturbed
from afm_scan_ros.cli.options import working
from afm_scan_ros.report.table import Row, Table

TRIALS = 20
"""At each rate, of each of the two."""
RATES = (20_000, 100_000, 200_000)
LINE_RATE = 20.0
DURATION = 16.0
"""Seconds: DDS counts a killed reader for ten."""
SIGNALS = {"killed": signal.SIGKILL, "stopped": signal.SIGSTOP}
_LATEST = 5.0

COLUMNS = {
    "rate_khz": ("rate, kHz", "g"),
    "viewer": ("viewer", ""),
    "trials": ("trials", "d"),
    "whole": ("whole scans", "d"),
    "samples": ("samples a scan", ",d"),
    "trouble": ("what was missing", ""),
}


def measure(trials: int = TRIALS) -> Table:
    """Disturb so many scans at each rate in each way."""
    with working("viewers") as announce, TemporaryDirectory() as folder:
        rows = [
            row
            for rate in RATES
            for row in disturb(Path(folder) / str(rate), rate, trials, announce)
        ]
    title = f"A viewer killed or stopped within a scan of {DURATION:g} s ({load()})"
    return Table("viewers", title, COLUMNS, rows)


def disturb(folder: Path, rate: int, trials: int, announce: Announce) -> Iterator[Row]:
    """Let a viewer fall out in each way at a rate (Hz), at moments drawn from the trial's number.

    Yields a row for each way. Raises ScanError where the undisturbed scan does not end well.
    """
    spec = _scan(rate)
    folder.mkdir()
    calm = undisturbed(folder, spec)
    for kind, number in SIGNALS.items():
        troubles = []
        fault = f"a viewer at {rate // 1000} kHz that is {kind}"
        for trial, place in numbered(announce, fault, trials, str(folder)):
            trouble = view(place, trial, number, spec, calm)
            troubles += [f"{trial}: {trouble}"] if trouble else []
        yield {
            "rate_khz": rate / 1000,
            "viewer": kind,
            "trials": trials,
            "whole": trials - len(troubles),
            "samples": calm.total_samples,
            "trouble": "; ".join(troubles),
        }


def view(
    folder: Path,
    trial: int,
    number: signal.Signals,
    spec: Mapping[str, object],
    calm: Undisturbed,
) -> str:
    """Make one scan with a second recorder, which is no part of it; say what it cost, if anything.

    The bag is removed where it is whole.
    """
    moment = float(np.random.default_rng(trial).uniform(0.0, _LATEST))
    with Trial(folder, **{NODES[0]: spec}) as scan:
        viewer = scan.start_another("scan_recorder", "viewer")
        scan.start(*NODES)
        scan.until_running()
        scan.listen(moment)
        viewer.send(number)
        scan.until_ended()
        if set(scan.statuses().values()) != {0}:
            return "; ".join(node.message.strip() for node in scan.nodes.values() if node.status)
        missing = calm.missing(scan.bag)
    if not missing:
        shutil.rmtree(folder)
    return missing


def load() -> str:
    """Describe the machine's work, since it decides what can be kept up with."""
    return f"{os.cpu_count()} cores, load {os.getloadavg()[1]:.1f} in the last five minutes"


def _scan(rate: int) -> Mapping[str, object]:
    """Return the scan at a sample rate (Hz), in blocks of the size that nobody states."""
    return {
        "line_rate_hz": LINE_RATE,
        "lines": round(DURATION * LINE_RATE),
        "samples_per_line": round(rate / LINE_RATE),
        "block_size": 0,
        "window": 0,
    }
