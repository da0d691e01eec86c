"""Nodes that start in any order, are slow, join late, or are started anew."""

import signal
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from afm_scan_bench.faults.faults import Announce, row
from afm_scan_bench.faults.injection.bag import Undisturbed
from afm_scan_bench.faults.injection.processes import INCOMPLETE, NODES
from afm_scan_bench.faults.injection.trial import (
    CONSUMERS,
    PATIENT,
    Trial,
    numbered,
    undisturbed,
)
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.report.table import Row

TRIALS = 40
"""Of each of the five."""
Chance = np.random.Generator


def inject(announce: Announce, trials: int = TRIALS) -> Iterator[Row]:
    """Disturb scans so, by what is drawn from the trial's number."""
    with TemporaryDirectory() as folder:
        calm = undisturbed(Path(folder))
        for kind, disturb in DISTURBANCES.items():
            broken = []
            for number, where in numbered(announce, kind, trials, folder):
                trouble = scan(where, disturb, number, calm)
                broken += [f"{number}: {trouble}"] if trouble else []
            yield row(kind, trials, broken, f"{calm.total_samples} samples a scan")


def scan(folder: Path, disturb: "Disturbance", number: int, calm: Undisturbed) -> str:
    """Make one scan and disturb it; return what is amiss, if anything."""
    pace = 1.0 if disturb in (late, anew_within) else 0.0
    source = {**PATIENT[NODES[0]], "time_scale": pace}
    with Trial(folder, **{**PATIENT, NODES[0]: source}) as trial:
        return disturb(trial, np.random.default_rng(number), calm)


def in_any_order(trial: Trial, chance: Chance, calm: Undisturbed) -> str:
    """Start the nodes in an order and at moments that are drawn."""
    for name in chance.permutation(NODES).tolist():
        trial.start(name)
        trial.listen(chance.exponential(0.5))
    return _whole(trial, calm)


def slow(trial: Trial, chance: Chance, calm: Undisturbed) -> str:
    """Stop one of the consumers again and again for up to half a second."""
    victim = str(chance.choice(CONSUMERS))
    trial.start(*chance.permutation(NODES).tolist())
    trial.until_running()
    while trial.nodes[victim].status is None:
        for number in (signal.SIGSTOP, signal.SIGCONT):
            trial.nodes[victim].send(number)
            trial.listen(chance.uniform(0.0, 0.5))
    return _whole(trial, calm)


def late(trial: Trial, chance: Chance, calm: Undisturbed) -> str:
    """Let one more node join the scan that runs: it must report that it is late."""
    trial.start(*chance.permutation(NODES).tolist())
    trial.until_running()
    trial.listen(chance.uniform(0.0, 0.2))
    kind = str(chance.choice(("tracking_monitor", "scan_recorder")))
    another = trial.start_another(kind, "another")
    trouble = _whole(trial, calm)
    trial.until(lambda: another.status is not None)
    reported = another.status == INCOMPLETE and "this node came late" in another.message
    return trouble or ("" if reported else f"the late node reported {another.message!r}")


def anew_before(trial: Trial, chance: Chance, calm: Undisturbed) -> str:
    """Kill a node that waits for the scan, and start it again; a bag is never written twice."""
    victim = str(chance.choice(CONSUMERS[:-1]))
    last = str(chance.choice([name for name in NODES if name != victim]))
    trial.start(*(name for name in NODES if name != last))
    trial.listen(chance.uniform(0.0, 2.0))
    trial.nodes[victim].send(signal.SIGKILL)
    trial.listen(chance.uniform(0.0, 2.0))
    trial.start(victim)
    trial.listen(chance.uniform(0.0, 2.0))
    trial.start(last)
    return _whole(trial, calm)


def anew_within(trial: Trial, chance: Chance, calm: Undisturbed) -> str:
    """Kill a node of a scan that runs, and start it again: the others must end, and state why."""
    victim = str(chance.choice(NODES))
    trial.start(*chance.permutation(NODES).tolist())
    trial.until_running()
    trial.listen(chance.uniform(0.0, 0.5))
    if trial.nodes[victim].status is not None:
        return _whole(trial, calm)
    trial.nodes[victim].send(signal.SIGKILL)
    trial.listen(chance.uniform(0.0, 1.0))
    others = {name: node for name, node in trial.nodes.items() if name != victim}
    trial.start(victim)
    trial.until(lambda: all(node.status is not None for node in others.values()))
    wrong = [
        f"{name} ended with {node.status}"
        for name, node in others.items()
        if node.status != INCOMPLETE
    ]
    try:
        calm.kept(trial.bag)
    except InputError as error:
        wrong.append(str(error))
    return f"{victim} anew: {', '.join(wrong)}" if wrong else ""


def _whole(trial: Trial, calm: Undisturbed) -> str:
    """Say what is missing of a scan that should be whole."""
    trial.until_ended()
    if set(trial.statuses().values()) != {0}:
        texts = "; ".join(node.message.strip() for node in trial.nodes.values() if node.status != 0)
        return f"{trial.statuses()}: {texts}"
    return calm.missing(trial.bag)


Disturbance = Callable[[Trial, Chance, Undisturbed], str]
DISTURBANCES: Mapping[str, Disturbance] = {
    "any order and delay of starting": in_any_order,
    "a slow consumer": slow,
    "a late joiner": late,
    "a node killed and started anew before the scan": anew_before,
    "a node killed and started anew within the scan": anew_within,
}
