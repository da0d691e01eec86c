"""``afm-scan survey``: diagnoses many recordings, and says which instruments changed and when."""

import math
import re
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from re import Pattern

import click
from attrs import evolve, frozen

from afm_scan_ros.cli.options import FIGURES, FOLDER, RECORD, grouped, positive
from afm_scan_ros.cli.progress import working
from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.types import Step
from afm_scan_ros.features.survey.assignment import (
    Assignment,
    FoundBag,
    found_bags,
    instrument_of,
    model_digest,
    survey_bag,
)
from afm_scan_ros.features.survey.changes import changes
from afm_scan_ros.features.survey.folder import TABLE, SurveyFolder, require_parquet
from afm_scan_ros.features.survey.page import PLACE, Survey, alert, summary, survey_report
from afm_scan_ros.features.survey.recording import Recording
from afm_scan_ros.features.survey.workers import Outcome, WorkerOptions, worker_options
from afm_scan_ros.model import load_model
from afm_scan_ros.report.table import show
from afm_scan_ros.report.terminal import say

PAGE, REPORTS = "survey.html", "reports"
FALSE_ALARM = 0.01
Run = Callable[[Sequence[Assignment]], Iterator[Outcome[Assignment, Recording]]]


def _pattern(_: click.Context, __: click.Parameter, given: str | None) -> Pattern[str] | None:
    try:
        rule = None if given is None else re.compile(given)
    except re.error as error:
        raise click.BadParameter(f"'{given}': {error}: give a regular expression") from error
    if rule is not None and rule.groups != 1:
        raise click.BadParameter(f"'{given}' has {rule.groups} groups: give one, as '(afm[0-9]+)'")
    return rule


@frozen
class WatchOptions:
    """How long to wait between looks, s, and how many recordings are enough; infinite for none."""

    every: float
    until: float


def _watching(every: float, until: int | None, *, watch: bool) -> WatchOptions | None:
    return WatchOptions(every, until or math.inf) if watch else None


watch_options = grouped(
    "watching",
    _watching,
    click.option("--watch", is_flag=True, help="Keep looking for new bags that are complete."),
    click.option(
        "--every",
        type=positive("s"),
        default="60s",
        show_default=True,
        help="Time between looks, with --watch.",
    ),
    click.option("--until", type=click.IntRange(1), help="Recordings at which --watch ends."),
)


@frozen
class Surveyor:
    """Surveys bags: those that the ``folder`` keeps unchanged are not diagnosed again."""

    model: str
    rule: Pattern[str] | None
    folder: SurveyFolder
    false_alarm: float
    run: Run
    reports: bool = False
    figures: str | None = None

    def survey(self, bags: Sequence[FoundBag]) -> Survey:
        """Diagnose what is new among bags; write table and page of all that is kept.

        An error counts as long as its bag is given.
        """
        assigned = {bag.name: self._assigned(bag) for bag in bags}
        kept = {n: r for n, r in self.folder.kept().items() if not r.error or n in assigned}
        new = {task: name for name, task in assigned.items() if not task.is_of(kept.get(name))}
        with working("surveying", at_once=False) as progress:
            for number, (task, outcome) in enumerate(self.run(tuple(new)), start=1):
                if isinstance(outcome, Recording):
                    kept[new[task]] = outcome
                    self.folder.keep(new[task], outcome)
                else:
                    kept[new[task]] = task.failed(outcome)
                progress(Step(f"{number} of {len(new)}: {task.bag}", number, len(new)))
        for name, task in assigned.items():
            kept[name] = evolve(kept[name], bag=task.bag, instrument=task.instrument)
        return self._written(sorted(kept.values(), key=lambda r: (r.instrument, r.recorded, r.bag)))

    def _assigned(self, bag: FoundBag) -> Assignment:
        instrument = instrument_of(bag.path, self.rule)
        file = Path(self.model.replace(PLACE, instrument))
        known = model_digest(file) if file.exists() else ""
        folder = str(self._report_folder(bag.identity)) if self.reports else ""
        return Assignment(
            str(bag.path.absolute()), instrument, bag.identity, str(file), known, folder
        )

    def _report_folder(self, identity: str) -> Path:
        return self.folder.path / REPORTS / identity[:16]

    def _reports(self, recordings: Sequence[Recording]) -> dict[str, str]:
        """Addresses of the reports of single recordings, by bag, as far as they are written."""
        files = {r.bag: self._report_folder(r.identity) / "report.html" for r in recordings}
        root = self.folder.path
        return {
            bag: file.relative_to(root).as_posix() for bag, file in files.items() if file.exists()
        }

    def _written(self, recordings: Sequence[Recording]) -> Survey:
        found = Survey(recordings, changes(recordings, self.false_alarm), self.false_alarm)
        self.folder.save_table(recordings)
        made = survey_report(found, self._reports(recordings), self.model, datetime.now(UTC))
        made.write(self.folder.path / PAGE, self.figures)
        return found


@click.command()
@click.argument("bags", nargs=-1, required=True, type=RECORD, metavar="BAG...")
@click.option(
    "--model",
    required=True,
    help="Model file. '{instrument}' in it stands for the instrument of each bag.",
)
@click.option("--out", required=True, type=FOLDER, help=f"Folder for {TABLE} and {PAGE}.")
@click.option(
    "--instrument",
    "rule",
    metavar="REGEX",
    callback=_pattern,
    help="Regular expression that is searched in a bag's absolute path: its group is the"
    " instrument. By default a bag's metadata states it, or else it is the folder that holds it.",
)
@click.option(
    "--false-alarm",
    type=click.FloatRange(0.0, 0.5, min_open=True),
    default=FALSE_ALARM,
    show_default=True,
    help="Probability, at most, that a survey of unchanged instruments reports a change.",
)
@click.option(
    "--reports",
    is_flag=True,
    help="Write the report of each recording too, to which the page links; this takes longer.",
)
@FIGURES
@worker_options
@watch_options
def survey(  # noqa: PLR0913 - click hands over one parameter an option
    bags: tuple[Path, ...],
    model: str,
    out: Path,
    rule: Pattern[str] | None,
    false_alarm: float,
    workers: WorkerOptions,
    watching: WatchOptions | None,
    *,
    reports: bool,
    figures: str | None,
) -> None:
    """Diagnose any number of recordings; say which instruments changed, and when.

    A BAG is a rosbag2 folder, an .mcap file, or a folder that holds bags at any depth. A bag that
    --out keeps from an earlier run, with the same model and version, is not diagnosed again.

    The exit status is 0 if nothing changed. It is 3 if an instrument changed, or if a recording
    could not be diagnosed. It is 130 after Ctrl-C; --watch then ends with 0 or 3.
    """
    require_parquet()
    if PLACE not in model:
        load_model(Path(model))
    run = partial(workers.run, survey_bag)
    surveyor = Surveyor(model, rule, SurveyFolder(out), false_alarm, run, reports, figures)
    found = _watched(surveyor, bags, watching) if watching else _surveyed(surveyor, bags)
    if found is None:
        return
    say(f"Table: {out / TABLE}. Report: {out / PAGE}.")
    if found.changes or found.failed:
        raise ScanError(
            f"instruments that changed: {len(found.changed)}; recordings that could not be"
            f" diagnosed: {len(found.failed)} of {len(found.recordings)}"
        )


def _surveyed(surveyor: Surveyor, paths: Sequence[Path]) -> Survey:
    given = found_bags(paths)
    if not given:
        raise InputError(f"{', '.join(map(str, paths))}: holds no bag: give bags, or their folders")
    found = surveyor.survey(given)
    show(summary(found))
    return found


def _watched(surveyor: Surveyor, paths: Sequence[Path], options: WatchOptions) -> Survey | None:
    """Survey what is complete and unchanged since the last look; None where there was nothing.

    An interrupt ends it.
    """
    found, seen, surveyed = None, set[FoundBag](), set[FoundBag]()
    alerts: set[str] = set()
    with suppress(KeyboardInterrupt):
        while found is None or len(found.recordings) < options.until:
            there = {bag for bag in found_bags(paths) if bag.complete}
            if (steady := there & seen) - surveyed:
                found, surveyed = surveyor.survey(sorted(steady)), steady
                new = [some for name, some in found.changed.items() if name not in alerts]
                show(map(alert, new))
                alerts = set(found.changed)
            else:
                seen = there
                time.sleep(options.every)
    return found
