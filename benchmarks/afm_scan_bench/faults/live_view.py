"""A scan at 100 kHz in real time beside its live view, which is open, or is killed or stopped."""

import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from contextlib import ExitStack, suppress
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from unittest import mock

import numpy as np
import rerun as rr
from attrs import evolve, field, frozen
from mcap.reader import make_reader

from afm_scan_bench.faults.machine import load
from afm_scan_ros.bag.reader import read_scan
from afm_scan_ros.bag.scan_info import DISPLACEMENT, decode_block
from afm_scan_ros.cli.execution import how_scans_run
from afm_scan_ros.cli.progress import working
from afm_scan_ros.core.streams import end
from afm_scan_ros.core.types import AXES, Array
from afm_scan_ros.features.view.viewer import PORT_VARIABLE, ViewSettings, serving
from afm_scan_ros.report.table import Row, Table

TRIALS = 20
PLAIN, TO_A_FILE = "none", "open, a file"
MOST = 0.99
"""Share of the samples whose latency is given beside the median."""
SPEC = """\
/**/trajectory_generator:
  ros__parameters: {range_x_um: 10.0, range_y_um: 10.0, line_rate_hz: 20.0, lines: 50,
    samples_per_line: 5000, preparation_cycles: 2, scan_id: one}
"""
STREAMS = (
    "desired_displacement",
    "drive_voltage",
    "achieved_displacement",
    "true_displacement",
)
EARLIEST, LATEST = 0.2, 2.5
"""When the view falls out, s after the bag was begun."""
PORT = 24_000
FEEDER = "afm_scan_ros.features.view.process"
MAIN = "from afm_scan_ros.cli.main import main; main()"

COLUMNS = {
    "view": ("view", ""),
    "trials": ("trials", "d"),
    "equal": ("scans whole and equal to the bit", "d"),
    "lost": ("lost samples", "d"),
    "longer_s": ("longer than without, s: median", ".2f"),
    "longest_s": ("at worst", ".2f"),
    "latency_s": ("from the sample to the view, s: median", ""),
    "most_s": (f"{MOST:.0%} within", ""),
    "latest_s": ("at worst", ""),
    "trouble": ("what was wrong", ""),
}
FALLS_OUT: Mapping[str, tuple[bool, signal.Signals | None]] = {
    "open": (False, None),
    "viewer killed": (False, signal.SIGKILL),
    "viewer stopped": (False, signal.SIGSTOP),
    "its feeder killed": (True, signal.SIGKILL),
    "its feeder stopped": (True, signal.SIGSTOP),
}


@frozen
class Run:
    """One scan: how long it took (s), its samples, (streams, axes, n), and how late they were seen.

    ``latencies`` (s) are those of the samples of a curve, where they are known.
    """

    duration: float
    samples: Array
    total: int
    latencies: Array = field(factory=lambda: np.empty(0))
    trouble: str = ""


def measure(trials: int = TRIALS) -> Table:
    """Scan so often without a view, with one, and with one that falls out in each way."""
    scans: dict[str, Callable[[Path, int], Run]] = {
        PLAIN: _plain,
        TO_A_FILE: _to_a_file,
        **{kind: partial(_beside_viewer, kind) for kind in FALLS_OUT},
    }
    runs: dict[str, list[Run]] = {kind: [] for kind in scans}
    with TemporaryDirectory() as folder, working("live_view") as announce:
        (Path(folder) / "spec.yaml").write_text(SPEC, "utf-8")
        for trial in range(trials):
            for kind, scan in scans.items():
                announce(f"{trial + 1} of {trials}, {kind}")
                runs[kind].append(scan(Path(folder), trial))
    rows = [_row(kind, found, runs[PLAIN]) for kind, found in runs.items()]
    how = f"each scan ran {how_scans_run()}; {load()}"
    return Table("live_view", f"The live view of a scan at 100 kHz: {how}", COLUMNS, rows)


def _row(view: str, runs: list[Run], plain: list[Run]) -> Row:
    """Compare scans with those without a view, each with the one that was made next to it."""
    longer = [run.duration - other.duration for run, other in zip(runs, plain, strict=True)]
    late = np.concatenate([run.latencies for run in runs])
    whole = next((run.samples for run in plain if not run.trouble), np.empty(0))
    return {
        "view": view,
        "trials": len(runs),
        "equal": sum(not run.trouble and np.array_equal(run.samples, whole) for run in runs),
        "lost": sum(run.total - run.samples.shape[-1] for run in runs if not run.trouble),
        "longer_s": float(np.median(longer)),
        "longest_s": max(longer),
        "latency_s": f"{np.median(late):.3f}" if late.size else "",
        "most_s": f"{np.quantile(late, MOST):.3f}" if late.size else "",
        "latest_s": f"{late.max():.3f}" if late.size else "",
        "trouble": "; ".join(run.trouble for run in runs if run.trouble),
    }


def _plain(folder: Path, _: int) -> Run:
    with _scanning(folder, bag := folder / "bag") as scan:
        found = _ended(scan, bag)
    shutil.rmtree(bag, ignore_errors=True)
    return found


def _to_a_file(folder: Path, trial: int) -> Run:
    bag, shown = folder / "bag", folder / f"shown{trial}.rrd"
    with _scanning(folder, bag, "--view", str(shown)) as scan:
        found = _ended(scan, bag)
    if found.trouble:
        return found
    latencies = _latencies(bag, shown)
    shutil.rmtree(bag)
    return evolve(found, latencies=latencies)


def _beside_viewer(kind: str, folder: Path, trial: int) -> Run:
    """Scan beside a viewer that browsers may open, which falls out at a moment by the trial."""
    of_feeder, number = FALLS_OUT[kind]
    port = {PORT_VARIABLE: str(PORT)}
    moment = float(np.random.default_rng(trial).uniform(EARLIEST, LATEST))
    with ExitStack() as open_ends:
        open_ends.enter_context(mock.patch.dict(os.environ, port))
        viewer = open_ends.enter_context(serving(ViewSettings()))
        scan = open_ends.enter_context(_scanning(folder, bag := folder / "bag", "--view"))
        if number is not None:
            _await_bag(bag, scan)
            time.sleep(moment)
            fallen = _feeder(scan.pid) if of_feeder else viewer.pid
            os.kill(fallen, number)
            open_ends.callback(_continue, fallen)
        found = _ended(scan, bag)
        shutil.rmtree(bag, ignore_errors=True)
        return found


def _continue(pid: int) -> None:
    """Let a process go on that was stopped, so that it ends; one that was killed is gone."""
    with suppress(ProcessLookupError):
        os.kill(pid, signal.SIGCONT)


def _scanning(folder: Path, bag: Path, *view: str) -> "subprocess.Popen[str]":
    own = ["--spec", str(folder / "spec.yaml"), "--time-scale", "1", "--bag", str(bag), *view]
    return subprocess.Popen(  # noqa: S603 - our own interpreter and module
        [sys.executable, "-c", MAIN, "scan", *own],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def _ended(scan: "subprocess.Popen[str]", bag: Path) -> Run:
    """Wait for a scan, which began a moment ago; return what it recorded."""
    began = _begun(scan.pid)
    _, said = scan.communicate()
    duration = time.monotonic() - began
    if scan.returncode:
        return Run(duration, np.empty(0), 0, trouble=said.strip().splitlines()[-1])
    recording = read_scan(bag)
    traces = [recording.whole(name) for name in STREAMS]
    samples = np.stack([[trace.axis(axis) for axis in AXES] for trace in traces])
    return Run(duration, samples, recording.info.total_samples)


def _begun(pid: int) -> float:
    """Return when a process was started, on the monotonic clock (s)."""
    after_boot = Path(f"/proc/{pid}/stat").read_text("utf-8").rpartition(")")[2].split()[19]
    return int(after_boot) / os.sysconf("SC_CLK_TCK")


def _await_bag(bag: Path, scan: "subprocess.Popen[str]") -> None:
    while not bag.exists() and scan.poll() is None:
        time.sleep(0.01)


def _feeder(parent: int) -> int:
    """Return the process that feeds the viewer, of those that a scan has started."""
    for stat in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):
            own = stat.read_text("utf-8").rpartition(")")[2].split()[1]
            if int(own) == parent and FEEDER in (stat.parent / "cmdline").read_text("utf-8"):
                return int(stat.parent.name)
    raise RuntimeError("the scan has no process that feeds the viewer")


def _latencies(bag: Path, shown: Path) -> Array:
    """Return how long (s) after each sample of the curve the viewer was given it.

    The scan ran in real time, and a block is recorded no sooner than its last sample is achieved.
    """
    (file,) = bag.glob("*.mcap")
    period, starts = read_scan(bag).info.sample_period, []
    with file.open("rb") as stream:
        for _, _, message in make_reader(stream).iter_messages(topics=["/achieved_displacement"]):
            stop = end(decode_block(DISPLACEMENT, message.data).trace)
            starts.append(1e-9 * message.log_time - stop * period)
    path = "/displacement/achieved/x"
    view = rr.dataframe.load_recording(shown).view(index="scan_time", contents=path)
    table = view.select("scan_time", "wall_clock").read_all()
    sample, given = (table[i].cast("int64").to_numpy() * 1e-9 for i in range(2))
    latencies: Array = given - sample - min(starts)
    return latencies
