"""How long after a fault the outputs are at rest, and whether the reason is named."""

import os
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory

from afm_scan_bench.faults.faults import Announce
from afm_scan_bench.faults.injection import cut, drive
from afm_scan_bench.faults.injection.drive import DriveOutcome
from afm_scan_bench.faults.injection.faulty_scanner import FAULTS
from afm_scan_bench.faults.injection.trial import numbered
from afm_scan_bench.faults.machine import load
from afm_scan_ros.cli.progress import working
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.report.table import Row, Table

TRIALS = 20
"""Of each fault."""
LIMIT = 0.5
"""Seconds from the fault until the outputs are at rest."""

COLUMNS = {
    "fault": ("fault", ""),
    "trials": ("trials", "d"),
    "median_s": ("at rest after, s: median", ".2f"),
    "largest_s": ("largest", ".2f"),
    "in_time": (f"within {LIMIT:g} s", "d"),
    "named": ("reason named", "d"),
    "output_v": ("output before, V", ".1f"),
    "trouble": ("what else was wrong", ""),
}


def measure(trials: int = TRIALS) -> Table:
    """Inject each fault so many times; raises InputError without the rights of root."""
    if os.geteuid() != 0:
        raise InputError("bench drive: cuts a network between namespaces: run it as root")
    with working("drive") as announce:
        rows = list(inject(announce, trials))
    return Table("drive", f"From a fault to outputs at rest ({load()})", COLUMNS, rows)


def inject(announce: Announce, trials: int) -> Iterator[Row]:
    """Inject each fault so many times."""
    ways: dict[str, Callable[[Path], DriveOutcome]] = {
        **{fault.name: partial(drive.endanger, fault=fault) for fault in FAULTS},
        cut.NAME: cut.endanger,
    }
    with TemporaryDirectory() as folder:
        for number, (name, endanger) in enumerate(ways.items()):
            scans = numbered(announce, f"{name},", trials, str(Path(folder) / str(number)))
            yield row(name, [endanger(where) for _, where in scans])


def row(fault: str, done: Sequence[DriveOutcome]) -> Row:
    """Describe what became of a fault; a time that is not known is not in time."""
    times = [each.seconds for each in done]
    return {
        "fault": fault,
        "trials": len(done),
        "median_s": median(times),
        "largest_s": max(times),
        "in_time": sum(bool(seconds <= LIMIT) for seconds in times),
        "named": sum(each.named for each in done),
        "output_v": min(each.drive for each in done),
        "trouble": "; ".join(text for each in done for text in each.broken),
    }
