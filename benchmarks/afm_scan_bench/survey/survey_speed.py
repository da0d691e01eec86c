"""A survey on Dask workers: two against one, and with a worker killed while it works.

The bags hold one scan of the default scanner, of 10 s, each with noise of its own. Every worker has
diagnosed some bags before, so that loading the package is not counted. Table and page are.
"""

import os
import signal
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter

import dask
from attrs import evolve, frozen
from distributed import LocalCluster

from afm_scan_bench.scans import ALL, BENCH_SPEC, scan
from afm_scan_bench.survey.fleet import NIGHT, START
from afm_scan_ros.bag.writer import ScanWriter
from afm_scan_ros.core.scan_info import info_of_scan
from afm_scan_ros.core.trajectory import total_samples
from afm_scan_ros.features.survey.assignment import (
    Assignment,
    FoundBag,
    found_bags,
    survey_bag,
)
from afm_scan_ros.features.survey.folder import SurveyFolder
from afm_scan_ros.features.survey.recording import Recording
from afm_scan_ros.features.survey.survey_command import FALSE_ALARM, Surveyor
from afm_scan_ros.features.survey.workers import Outcome, on_cluster
from afm_scan_ros.files import share_directory
from afm_scan_ros.report.table import Row, Table

BAGS = 100
WORKERS = (1, 2)
WARM = 4
"""Bags for each worker, before time is taken."""
DASK = {
    "distributed.worker.profile.enabled": False,
    "distributed.admin.tick.interval": "1s",
    "distributed.worker.memory.monitor_interval": "1s",
}
"""Settings of the scheduler and the workers, as docs/how_to/survey.md gives them."""
SPEC = evolve(BENCH_SPEC, lines=40, samples_per_line=2000)
COLUMNS = {
    "workers": ("workers", ""),
    "seconds": ("s", ".1f"),
    "ratio": ("times as fast", ".2f"),
    "rows": ("rows", "d"),
    "lost": ("lost", "d"),
    "twice": ("done twice", "d"),
    "errors": ("not diagnosed", "d"),
}


def measure(bags: int = BAGS) -> Table:
    """Survey so many bags with one worker, with two, and with two of which one is killed."""
    with TemporaryDirectory() as name:
        folder = Path(name)
        for number in range(bags):
            _record(folder / f"bags/afm/night_{number:04}", number)
        found = found_bags([folder / "bags"])
        runs = [_Run(f"{n}", n, found, folder / f"of_{n}") for n in WORKERS]
        runs.append(_Run("2, one killed", 2, found, folder / "killed", kill_after=bags // 4))
        rows = list(_rows(runs))
    length = total_samples(SPEC) * SPEC.sample_period
    title = f"Survey of {bags} bags of {length:.1f} s by Dask workers of one process each"
    return Table("survey_speed", title, COLUMNS, rows)


def _record(folder: Path, number: int) -> None:
    done = scan(SPEC, ALL, seed=number)
    info = info_of_scan(SPEC, f"night {number}", START + number * NIGHT)
    with ScanWriter(folder, info) as bag:
        bag.add("drive_voltage", done.drive)
        bag.add("achieved_displacement", done.measured)


@frozen(eq=False)
class _Run:
    """A survey by some workers, the first of which is killed after so many results, if any."""

    name: str
    workers: int
    bags: Sequence[FoundBag]
    out: Path
    kill_after: int | None = None

    def row(self) -> Row:
        """Survey, and count what was done."""
        results: list[str] = []
        options = {"threads_per_worker": 1, "dashboard_address": None, "silence_logs": 50}
        with dask.config.set(DASK), LocalCluster(n_workers=self.workers, **options) as cluster:

            def run(tasks: Sequence[Assignment]) -> Iterator[Outcome[Assignment, Recording]]:
                for number, outcome in enumerate(
                    on_cluster(survey_bag, tasks, cluster.scheduler_address)
                ):
                    results.append(outcome[0].bag)
                    if number == self.kill_after:
                        os.kill(next(iter(cluster.workers.values())).process.pid, signal.SIGKILL)
                    yield outcome

            model = str(share_directory() / "config/model.yaml")
            make = partial(Surveyor, model, None, false_alarm=FALSE_ALARM)
            warm = partial(on_cluster, survey_bag, address=cluster.scheduler_address)
            make(SurveyFolder(self.out / "warm"), run=warm).survey(self.bags[: WARM * self.workers])
            begun = perf_counter()
            found = make(SurveyFolder(self.out), run=run).survey(self.bags)
            seconds = perf_counter() - begun
        return {
            "workers": self.name,
            "seconds": seconds,
            "rows": len(found.recordings),
            "lost": len(self.bags) - len({each.bag for each in found.recordings}),
            "twice": len(results) - len(set(results)),
            "errors": len(found.failed),
        }


def _rows(runs: Sequence[_Run]) -> Iterator[Row]:
    first = None
    for each in runs:
        row = each.row()
        first = first or float(row["seconds"])
        yield {**row, "ratio": first / float(row["seconds"])}
