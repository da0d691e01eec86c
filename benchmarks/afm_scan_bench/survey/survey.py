"""A survey of ten drawn instruments over twenty nights, three of which change.

Each instrument is identified from its calibration records while it is healthy. Every night it makes
one of two scans. Gain, resonance and creep scatter from night to night. The changes are a lower
gain, a heavier load, backlash or a delay, on one axis, from a drawn night on.
"""

import os
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

from afm_scan_bench.survey.fleet import NIGHT, START, Instrument, drawn_fleet, write_fleet
from afm_scan_ros.features.survey.assignment import found_bags, survey_bag
from afm_scan_ros.features.survey.changes import Change
from afm_scan_ros.features.survey.folder import SurveyFolder
from afm_scan_ros.features.survey.page import Survey
from afm_scan_ros.features.survey.survey_command import FALSE_ALARM, Surveyor
from afm_scan_ros.features.survey.workers import in_processes
from afm_scan_ros.report.table import Row, Table

INSTRUMENTS, CHANGING, NIGHTS, SEED = 10, 3, 20, 1
COLUMNS = {
    "instrument": ("instrument", ""),
    "true": ("change", ""),
    "night": ("from night", ""),
    "found": ("survey: changed", ""),
    "when": ("from night", ""),
    "named": ("diagnosis", ""),
    "verdicts": ("recordings that are not model_sufficient", "d"),
}


def measure(seed: int = SEED, jobs: int | None = None) -> Table:
    """Survey the instruments that a seed draws, with so many processes, all cores by default."""
    with TemporaryDirectory() as name:
        return table(Path(name), drawn_fleet(INSTRUMENTS, CHANGING, NIGHTS, seed), NIGHTS, jobs)


def table(folder: Path, fleet: Iterator[Instrument], nights: int, jobs: int | None = None) -> Table:
    """Record and survey instruments in a folder, and compare with the truth."""
    made = write_fleet(fleet, nights, folder)
    found = surveyed(folder, jobs or os.cpu_count() or 1)
    rows = [_row(each, found) for each in made]
    changed = [each for each in made if each.kind]
    right = sum(each.name in found.changed for each in changed)
    dated = sum(_dated(each, found.changed.get(each.name, ())) for each in changed)
    title = (
        f"{len(found.recordings)} recordings of {len(made)} instruments: {right} of {len(changed)}"
        f" changes found, {dated} with the night; {len(found.changed) - right} false"
    )
    return Table("survey", title, COLUMNS, rows)


def surveyed(folder: Path, jobs: int) -> Survey:
    """Survey the bags that ``write_fleet`` wrote."""
    model = str(folder / "models/{instrument}.yaml")
    run = partial(in_processes, survey_bag, jobs=jobs)
    surveyor = Surveyor(model, None, SurveyFolder(folder / "survey"), FALSE_ALARM, run)
    return surveyor.survey(found_bags([folder / "bags"]))


def _row(made: Instrument, found: Survey) -> Row:
    changes = found.changed.get(made.name, [])
    named = ", ".join(sorted({name for each in changes for name in each.effects}))
    own = [each for each in found.recordings if each.instrument == made.name]
    return {
        "instrument": made.name,
        "true": f"{made.kind} of {made.axis}" if made.kind else "",
        "night": str(made.night) if made.kind else "",
        "found": ", ".join(f"{each.name} of {each.axis}" for each in changes),
        "when": "{} to {}".format(*_nights(changes[0])) if changes else "",
        "named": named or ("names no effect" if changes else ""),
        "verdicts": sum(each.verdict != "model_sufficient" for each in own),
    }


def _dated(made: Instrument, changes: Sequence[Change]) -> bool:
    """Whether the surest change's interval holds the night."""
    if not changes:
        return False
    first, last = _nights(changes[0])
    return first <= made.night <= last


def _nights(change: Change) -> tuple[int, int]:
    """First and last night that the change may be from."""
    first, last = ((time - START) // NIGHT for time in (change.after, change.before))
    return first + 1, last
