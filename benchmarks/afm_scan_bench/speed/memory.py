"""How much memory each node and the analysis take at most, and with a scan ten times as long."""

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import count
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import Event, Thread, get_native_id

from afm_scan_bench.speed.timing.ratios import COLUMNS, row
from afm_scan_ros.cli.options import CONFIG
from afm_scan_ros.cli.orders import ScanFiles
from afm_scan_ros.cli.scan import run_scan
from afm_scan_ros.core.model import INVERSES
from afm_scan_ros.nodes import NODES
from afm_scan_ros.report.table import Table

RATE = 100_000  # samples a second
SHAPE = (75, 4000)
"""Lines, and samples in one."""
LONGER = {"ten times the lines": (10, 1), "lines ten times as long": (1, 10)}
TURNS = 3
SCAN = """
/**/trajectory_generator:
  ros__parameters: {{line_rate_hz: {}, samples_per_line: {}, lines: {}, preparation: none}}
"""
ANALYZE = ("-c", "from afm_scan_ros.cli.main import main; main()", "analyze")
PERIOD = 0.01

Peaks = dict[str, float]


def measure() -> Table:
    """Scan and analyse by turns, short and long."""
    return table(SHAPE, TURNS)


def table(shape: tuple[int, int], turns: int) -> Table:
    """Return the table of scans of so many lines of so many samples, and of ten times as long."""
    with TemporaryDirectory() as folder:
        bags = (Path(folder) / f"bag{number}" for number in count())
        found = [_turn(shape, bags) for _ in range(turns)]
    rows = [
        row(
            f"peak memory of {name}, {way}",
            "the scan a tenth as long",
            "MB",
            "≤ 1.05",
            [long[way][name] for _, long in found],
            [short[name] for short, _ in found],
        )
        for way in LONGER
        for name in found[0][0]
    ]
    title = f"Scans of {10 * shape[0] * shape[1]:,d} samples, and one of a tenth of them"
    return Table("memory", title, COLUMNS, rows)


def _turn(shape: tuple[int, int], bags: Iterator[Path]) -> tuple[Peaks, dict[str, Peaks]]:
    lines, samples = shape
    long = {
        way: _peaks(more * lines, longer * samples, next(bags))
        for way, (more, longer) in LONGER.items()
    }
    return _peaks(lines, samples, next(bags)), long


def _peaks(lines: int, samples: int, bag: Path) -> Peaks:
    spec = bag.with_suffix(".yaml")
    spec.write_text(SCAN.format(RATE / samples, samples, lines), "utf-8")
    files = ScanFiles(spec, CONFIG / "model.yaml", CONFIG / "plant.yaml", bag)
    with watched() as peaks:
        run_scan(files, INVERSES, 0.0, images=True, watched=True)
        subprocess.run([sys.executable, *ANALYZE, bag], check=True, stdout=subprocess.DEVNULL)  # noqa: S603 - our own interpreter
    return peaks


@contextmanager
def watched() -> Iterator[Peaks]:
    """Note the most memory, MB, of each process that this thread starts, by the node's name."""
    peaks: Peaks = {}
    over = Event()
    children = Path(f"/proc/self/task/{get_native_id()}/children")

    def watch() -> None:
        while not over.wait(PERIOD):
            for number in children.read_text("utf-8").split():
                _note(Path("/proc") / number, peaks)

    thread = Thread(target=watch)
    thread.start()
    try:
        yield peaks
    finally:
        over.set()
        thread.join()


def _note(process: Path, peaks: Peaks) -> None:
    try:
        command = (process / "cmdline").read_text("utf-8")
        status = (process / "status").read_text("utf-8")
    except OSError:  # it has ended
        return
    name = next((name for name in (*NODES, "analyze") if name in command), None)
    peak = next((line for line in status.splitlines() if line.startswith("VmHWM")), None)
    if name is not None and peak is not None:
        peaks[name] = max(peaks.get(name, 0.0), int(peak.split()[1]) / 1024)
