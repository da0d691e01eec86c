"""A disk that becomes full during a scan: a small tmpfs, or where that needs root a size limit."""

import os
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from attrs import define, field

from afm_scan_bench.faults.faults import Announce, row
from afm_scan_bench.faults.injection.bag import Undisturbed
from afm_scan_bench.faults.injection.processes import INCOMPLETE, NO_LIMIT, NODES, system
from afm_scan_bench.faults.injection.trial import Trial, numbered, undisturbed
from afm_scan_ros.bag.writer import CHUNK_BYTES
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.report.table import Row

TRIALS = 20
SMALLEST, LARGEST = 100_000, 3_000_000
"""Bytes that there is room for; the bag needs more."""
_SAMPLE = 64
"""Bytes of a sample of all four topics."""
RECORDER = "scan_recorder"


@define
class Filled:
    """What was kept of a bag, in bytes of samples and as a share of the room."""

    room: int
    kept: int = 0
    broken: list[str] = field(factory=list)


def inject(announce: Announce, trials: int = TRIALS) -> Iterator[Row]:
    """Record into room that is too small, drawn from the trial's number."""
    root = os.geteuid() == 0
    with TemporaryDirectory() as folder:
        calm = undisturbed(Path(folder))
        filled = numbered(announce, "fills disk", trials, folder)
        done = [fill(where, number, calm, mounted=root) for number, where in filled]
    lost = max(each.room - each.kept for each in done)
    broken = ["; ".join(each.broken) for each in done if each.broken]
    figures = f"at most {lost / 1e6:.2f} MB of the room hold no sample that can be read"
    kind = "disk full (tmpfs)" if root else "file too large (limit)"
    yield row(kind, trials, broken, figures)


def fill(folder: Path, number: int, calm: Undisturbed, *, mounted: bool) -> Filled:
    """Record one scan into too little room, and read what was written."""
    room = int(np.random.default_rng(number).integers(SMALLEST, LARGEST))
    room -= room % os.sysconf("SC_PAGE_SIZE")
    done = Filled(room)
    disk = folder.with_name(f"{folder.name}_disk")
    disk.mkdir()
    bag = {"bag": str(disk / "bag")}
    full = _tmpfs(disk, room) if mounted else nullcontext()
    with full, Trial(folder, scan_recorder=bag) as trial:
        trial.start(*NODES[:-1])
        trial.start(RECORDER, room=NO_LIMIT if mounted else room)
        if not trial.until_ended():
            done.broken.append("hung")
        _judge(trial, calm, done)
    return done


LOGGED = ("[", "\x1b[")
"""Beginnings of lines that ROS logs, or Fast DDS: its shared memory is a file that may not grow."""


def _judge(trial: Trial, calm: Undisturbed, done: Filled) -> None:
    message = trial.nodes[RECORDER].message
    lines = [line for line in message.strip().split("\n") if not line.startswith(LOGGED)]
    if len(lines) != 1 or str(trial.bag) not in message or "make room" not in message:
        done.broken.append(f"the recorder reported: {message!r}")
    if set(trial.statuses().values()) != {INCOMPLETE}:
        done.broken.append(f"statuses {trial.statuses()}")
    try:
        done.kept = calm.kept(trial.bag) * _SAMPLE
    except InputError as error:
        done.broken.append(str(error))
    if done.room - done.kept > 2 * CHUNK_BYTES:
        done.broken.append(f"of {done.room} bytes only {done.kept} read")


@contextmanager
def _tmpfs(folder: Path, room: int) -> Iterator[None]:
    system("/bin/mount", "-t", "tmpfs", "-o", f"size={room}", "tmpfs", str(folder))
    try:
        yield
    finally:
        system("/bin/umount", str(folder))
