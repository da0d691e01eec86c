"""SIGINT and SIGTERM, to a node of a scan and to the command that runs them all."""

import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory

import numpy as np
import yaml
from attrs import define, field

from afm_scan_bench.faults.faults import Announce, row
from afm_scan_bench.faults.injection.bag import Undisturbed
from afm_scan_bench.faults.injection.processes import INCOMPLETE, NODES
from afm_scan_bench.faults.injection.trial import PATIENCE, SCAN, Trial, numbered, undisturbed
from afm_scan_ros.bag.reader import read_scan
from afm_scan_ros.bag.writer import CHUNK_BYTES
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.report.table import Row

TRIALS = 30
DEADLINE = 2.0
"""Seconds within which the bag is closed."""
SIGNALS = (signal.SIGINT, signal.SIGTERM)
COMMAND = "afm-scan scan"
TARGETS = (*NODES, COMMAND)
_LONGEST = 2.0
_POLL = 0.01
_AFM_SCAN = (sys.executable, "-P", "-c", "from afm_scan_ros.cli.main import main; main()")


@define
class Signalled:
    """After how many seconds the bag was closed and all had ended; ``broken`` promises as text.

    ``closed`` alone shows that the bag was closed too late.
    """

    closed: float = float("nan")
    ended: float = float("nan")
    broken: list[str] = field(factory=list)


def inject(announce: Announce, trials: int = TRIALS) -> Iterator[Row]:
    """Signal each node, and the command, at moments drawn from the trial's number."""
    with TemporaryDirectory() as folder:
        calm = undisturbed(Path(folder))
        done: dict[signal.Signals, list[Signalled]] = {number: [] for number in SIGNALS}
        for number in SIGNALS:
            for trial, where in numbered(announce, number.name, trials, folder):
                done[number].append(interrupt(where, trial, number, calm))
    for number, each in done.items():
        broken = ["; ".join(one.broken) for one in each if one.broken]
        broken += ["closed too late" for one in each if one.closed > DEADLINE and not one.broken]
        closed = [one.closed for one in each]
        figures = (
            f"bag closed within {median(closed):.2f} s, worst {max(closed):.2f};"
            f" all ended within {max(one.ended for one in each):.2f} s"
        )
        yield row(number.name, trials, broken, figures)


def interrupt(folder: Path, trial: int, number: signal.Signals, calm: Undisturbed) -> Signalled:
    """Send one signal, and see that the bag is closed soon with all that it had."""
    target = TARGETS[trial % len(TARGETS)]
    moment = float(np.random.default_rng(trial).uniform(0.0, _LONGEST))
    by = _interrupt_command if target == COMMAND else _interrupt_node
    done = Signalled()
    bag = by(folder, target, number, moment, done)
    try:
        calm.kept(bag)
        done.broken += read_scan(bag).warnings
    except InputError as error:
        done.broken.append(str(error))
    return done


def _interrupt_node(
    folder: Path, target: str, number: signal.Signals, moment: float, done: Signalled
) -> Path:
    with Trial(folder) as trial:
        trial.start(*NODES)
        trial.until_running()
        trial.listen(moment)
        trial.nodes[target].send(number)
        sent = time.monotonic()
        if trial.until((trial.bag / "metadata.yaml").is_file):
            done.closed = time.monotonic() - sent
        trial.until_ended()
        done.ended = time.monotonic() - sent
        if set(trial.statuses().values()) != {INCOMPLETE}:
            done.broken.append(f"{target}, {number.name}: statuses {trial.statuses()}")
        if f"interrupted by {number.name}" not in trial.nodes[target].message:
            done.broken.append(f"{target} reported {trial.nodes[target].message!r}")
        return trial.bag


def _interrupt_command(
    folder: Path, target: str, number: signal.Signals, moment: float, done: Signalled
) -> Path:
    folder.mkdir()
    bag, spec = folder / "bag", folder / "scan.yaml"
    nodes = {"/**/trajectory_generator": {"ros__parameters": {**SCAN, "time_scale": 1.0}}}
    spec.write_text(yaml.safe_dump(nodes), "utf-8")
    arguments = [*_AFM_SCAN, "scan", "--spec", str(spec), "--bag", str(bag)]
    with subprocess.Popen(arguments, stderr=subprocess.PIPE, text=True) as process:  # noqa: S603 - ours
        _until(lambda: any(file.stat().st_size > CHUNK_BYTES for file in bag.glob("*.mcap")))
        time.sleep(moment)
        process.send_signal(number)
        sent = time.monotonic()
        if _until((bag / "metadata.yaml").is_file):
            done.closed = time.monotonic() - sent
        _, message = process.communicate(timeout=PATIENCE)
        done.ended = time.monotonic() - sent
    if message.strip() != "afm-scan: interrupted":
        done.broken.append(f"{target}, {number.name}: reported {message!r}")
    return bag


def _until(holds: Callable[[], bool]) -> bool:
    deadline = time.monotonic() + PATIENCE
    while not holds():
        if time.monotonic() > deadline:
            return False
        time.sleep(_POLL)
    return True
