"""How the time that a diagnosis takes grows with the record, up to ten minutes at 20 kHz."""

from collections.abc import Iterator
from math import log2
from time import perf_counter, process_time

from attrs import evolve

from afm_scan_bench.scans import ALL, BENCH_SPEC, default_model, scan
from afm_scan_ros.core.diagnosis.diagnosis import diagnose
from afm_scan_ros.core.record import Record
from afm_scan_ros.files import share_directory
from afm_scan_ros.files.plant_file import load_plant
from afm_scan_ros.report.table import Row, Table

LINES = (40, 256, 600, 3000)

COLUMNS = {
    "lines": ("lines", ",d"),
    "duration_s": ("record, s", ".0f"),
    "samples": ("samples of an axis", ",d"),
    "minutes": ("diagnosis, min", ".2f"),
    "us_per_sample": ("µs of a core a sample", ".1f"),
    "growth": ("over n log n, the first being 1", ".2f"),
    "verdict": ("verdict", ""),
}


def measure() -> Table:
    """Diagnose scans of more and more lines of a scanner whose displacement comes late."""
    title = "Time of a diagnosis: default scan, a delay that the model lacks"
    return Table("speed_diagnosis", title, COLUMNS, list(rows(LINES)))


def rows(counts: tuple[int, ...]) -> Iterator[Row]:
    """Yield a row for each number of lines; what the first use costs is taken before."""
    seconds(counts[0])
    first = 0.0
    for lines in counts:
        verdict, samples, duration, taken, spent = seconds(lines)
        cost = spent / (samples * log2(samples))
        first = first or cost
        yield {
            "lines": lines,
            "duration_s": duration,
            "samples": samples,
            "minutes": taken / 60.0,
            "us_per_sample": 1e6 * spent / samples,
            "growth": cost / first,
            "verdict": verdict,
        }


def seconds(lines: int) -> tuple[str, int, float, float, float]:
    """Verdict on a scan, its samples and its length; what its diagnosis took, and of cores, s."""
    plant = load_plant(share_directory() / "config/plants/delay_medium.yaml")
    spec = evolve(BENCH_SPEC, lines=lines)
    done = scan(spec, ALL, plant=plant)
    record = Record.of_traces("scan", done.drive, done.measured, spec)
    start, before = perf_counter(), process_time()
    found = diagnose(default_model(), [record])
    taken, spent, samples = perf_counter() - start, process_time() - before, len(done.drive.x)
    return found.verdict, samples, samples * spec.sample_period, taken, spent
