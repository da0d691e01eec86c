"""One more reader of every topic, killed or stopped while the scan runs in real time.

DDS has ROS's own settings, but for those that the nodes add.
"""

import signal
from collections.abc import Iterator, Mapping
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from afm_scan_bench.faults.faults import Announce, row
from afm_scan_bench.faults.injection.bag import Undisturbed
from afm_scan_bench.faults.injection.processes import NODES
from afm_scan_bench.faults.injection.trial import Trial, numbered, undisturbed
from afm_scan_ros.report.table import Row

TRIALS = 5
"""Of each of the two."""
RATES = (20_000, 100_000, 200_000)
DURATION = 20.0
"""Seconds: DDS counts a killed reader for ten."""
SIGNALS = {"killed": signal.SIGKILL, "stopped": signal.SIGSTOP}
_LATEST = 5.0


def _scan(rate: int) -> Mapping[str, object]:
    """Return the scan at a sample rate (Hz), in blocks of the size that nobody states."""
    return {
        "line_rate_hz": 20.0,
        "lines": round(DURATION * 20.0),
        "samples_per_line": rate // 20,
        "block_size": 0,
        "window": 0,
    }


def inject(announce: Announce, trials: int = TRIALS) -> Iterator[Row]:
    """Let a viewer fall out in each way, at moments drawn from the trial's number."""
    with TemporaryDirectory() as folder:
        for rate in RATES:
            spec, where = _scan(rate), Path(folder) / str(rate)
            where.mkdir()
            calm = undisturbed(where, spec)
            for kind, number in SIGNALS.items():
                fault, broken = f"a viewer at {rate // 1000} kHz that is {kind}", []
                for trial, place in numbered(announce, fault, trials, str(where)):
                    trouble = view(place, trial, number, spec, calm)
                    broken += [f"{trial}: {trouble}"] if trouble else []
                yield row(fault, trials, broken, f"{calm.total_samples} samples a scan")


def view(
    folder: Path,
    trial: int,
    number: signal.Signals,
    spec: Mapping[str, object],
    calm: Undisturbed,
) -> str:
    """Make one scan with a second recorder, which is no part of it; measure what it cost."""
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
        return calm.missing(scan.bag)
