"""Half an hour of scanning at 100 kHz: memory, what was lost, and how far behind the clock."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory

from attrs import define, field, frozen

from afm_scan_bench.faults.injection.processes import NODES
from afm_scan_bench.faults.injection.trial import PATIENT, Trial
from afm_scan_ros.bag.reader import read_scan
from afm_scan_ros.cli.progress import working
from afm_scan_ros.core.errors import ScanError
from afm_scan_ros.nodes.peers import RUNNING
from afm_scan_ros.nodes.topics import BLOCKS
from afm_scan_ros.report.table import Row, Table

MINUTES = 30.0
RATE = 100_000
LINE_RATE = 20.0
PERIOD = 1.0
"""Seconds between two looks at each node's memory."""
SHARE = 0.1
"""Of the looks that make the first and the last figure; as many are left out before them."""
SCANNER = "piezoscanner_sim"

COLUMNS = {
    "node": ("node", ""),
    "first_mb": ("at first, MB", ".1f"),
    "last_mb": ("at last, MB", ".1f"),
    "growth": ("growth", ".3f"),
}


@frozen
class MemoryUse:
    """What a node has of its own, at one moment, in bytes."""

    node: str
    size: int


@define
class Soaked:
    """What was seen of a long scan; ``lags`` are seconds of the scan behind those of the clock."""

    minutes: float
    samples: int = 0
    lags: list[float] = field(factory=list)
    memory: list[MemoryUse] = field(factory=list)


def measure(minutes: float = MINUTES) -> Table:
    """Scan so long, and read all of it back."""
    with TemporaryDirectory() as folder, working(f"soak of {minutes:g} minutes") as announce:
        parameters = {**PATIENT, NODES[0]: {**PATIENT[NODES[0]], **_spec(minutes)}}
        with Trial(Path(folder) / "soak", **parameters) as trial:
            done = _scanned(trial, minutes)
        announce("reads the bag")
        done.samples = _samples(trial.bag)
    return _table(done)


def _spec(minutes: float) -> Mapping[str, object]:
    return {
        "line_rate_hz": LINE_RATE,
        "lines": round(60.0 * minutes * LINE_RATE),
        "samples_per_line": round(RATE / LINE_RATE),
        "block_size": 5000,
        "window": 100_000,
        "time_scale": 1.0,
    }


def _scanned(trial: Trial, minutes: float) -> Soaked:
    """Let the scan run; raise ScanError where it does not end well."""
    done = Soaked(minutes)
    trial.start(*NODES)
    trial.until_running()
    while None in trial.statuses().values():
        trial.listen(PERIOD)
        done.memory += _memory(trial)
    if set(trial.statuses().values()) != {0}:
        texts = "; ".join(node.message.strip() for node in trial.nodes.values() if node.status)
        raise ScanError(f"the soak ended early: {texts}")
    message = [h for h in trial.heard if h.node == SCANNER and h.state == RUNNING and h.next_sample]
    began = min(each.moment - each.next_sample / RATE for each in message)
    done.lags = [each.moment - each.next_sample / RATE - began for each in message]
    return done


def _memory(trial: Trial) -> Iterator[MemoryUse]:
    for name, node in trial.nodes.items():
        try:
            status = Path(f"/proc/{node.process.pid}/status").read_text("utf-8")
        except OSError:  # it has just ended
            continue
        for line in status.split("\n"):
            if line.startswith("RssAnon:"):
                yield MemoryUse(name, 1024 * int(line.split()[1]))


def _samples(bag: Path) -> int:
    """Count the samples of a bag; raise InputError for a gap, ScanError for a missing end."""
    recording = read_scan(bag)
    count = sum(len(blocks[0].x) for blocks in recording.blocks(*BLOCKS))
    if count != recording.info.total_samples or recording.warnings:
        raise ScanError(f"{count} of {recording.info.total_samples} samples are in the bag")
    return count


def _table(done: Soaked) -> Table:
    late = done.lags[-len(done.lags) // 10 :]
    title = (
        f"Soak: {done.samples:,} samples in {done.minutes:g} minutes at {RATE / 1000:g} kHz,"
        f" none missing; behind the clock by {median(done.lags):.3f} s in the middle,"
        f" {max(done.lags):.3f} at worst, {median(late):.3f} at the end"
    )
    return Table("soak", title, COLUMNS, [_row(name, done.memory) for name in NODES])


def _row(name: str, memory: Sequence[MemoryUse]) -> Row:
    sizes = [each.size for each in memory if each.node == name]
    few = max(1, round(SHARE * len(sizes)))
    first, last = median(sizes[few : 2 * few]), median(sizes[-2 * few : -few])
    return {"node": name, "first_mb": first / 1e6, "last_mb": last / 1e6, "growth": last / first}
