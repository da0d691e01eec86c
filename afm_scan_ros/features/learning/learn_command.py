"""``afm-scan learn``: repeat a scan, and learn a correction of its reference."""

from collections.abc import Iterable, Iterator
from datetime import UTC, datetime
from functools import partial
from pathlib import Path

import click

from afm_scan_ros.cli.driving import DrivenScanner, RecordedSession, driven_options
from afm_scan_ros.cli.options import CONFIG, FIGURES, FILE, FOLDER, refuse_existing
from afm_scan_ros.cli.progress import working
from afm_scan_ros.cli.scan import drive_limits_of
from afm_scan_ros.core.diagnosis.diagnosis import diagnose
from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.metrics import plain
from afm_scan_ros.core.model import ScannerModel
from afm_scan_ros.core.types import AXES
from afm_scan_ros.features.learning import loop
from afm_scan_ros.features.learning.loop import learn as learning_scans
from afm_scan_ros.features.learning.report import (
    Taught,
    learning_document,
    learning_report,
    learning_text,
    taught_text,
)
from afm_scan_ros.files.drive_files import save_learned
from afm_scan_ros.files.model_file import load_model, save_model
from afm_scan_ros.files.plant_file import load_scan
from afm_scan_ros.nodes.parameters import FLOW
from afm_scan_ros.report.diagnosis_json import save_diagnosis
from afm_scan_ros.report.page import CommandLine, Provenance, heading_lines, provenance_of
from afm_scan_ros.report.table import show
from afm_scan_ros.report.terminal import say

HEADING = "A scanner's model with the effects that 'afm-scan learn' identified."


@click.command()
@click.option("--spec", type=FILE, default=CONFIG / "scan.yaml", help="Scan that is repeated.")
@click.option("--model", type=FILE, default=CONFIG / "model.yaml", help="Model file to invert.")
@driven_options
@click.option(
    "--scans",
    type=click.IntRange(min=loop.FEWEST),
    default=loop.SCANS,
    show_default=True,
    help="Number of scans; the first two have no correction.",
)
@click.option(
    "--out", required=True, type=FOLDER, help="Folder for learned.npz, report.html, bags."
)
@click.option(
    "--diagnose", "diagnosed", is_flag=True, help="Diagnose what the model lacks by the scans."
)
@FIGURES
def learn(
    spec: Path,
    model: Path,
    driven: DrivenScanner,
    scans: int,
    out: Path,
    *,
    diagnosed: bool,
    figures: str | None,
) -> None:
    """Repeat a scan, and learn a correction of its reference from the measured errors.

    learned.npz holds the correction of the best scan. 'afm-scan scan --learned' uses it. It
    belongs to this scan and this model.
    """
    base = load_model(model)
    for axis in AXES:
        base.axis(axis)
    wanted, _ = load_scan(spec, [parameter.name for parameter in FLOW])
    limits = drive_limits_of(driven.scanner, driven.plant)
    refuse_existing(out / "bags")
    session = RecordedSession(driven, out)
    done: list[loop.LearningScan] = []
    failure, ended = "", None
    try:
        for each in learning_scans(session, base, wanted, scans, limits):
            done.append(each)
            errors = ", ".join(f"{axis} {1e9 * each.errors[axis]:.1f} nm" for axis in AXES)
            say(f"scan {len(done)} of {scans}: measured error, rms: {errors}")
    except (InputError, ScanError, KeyboardInterrupt) as error:
        if not done:
            raise
        ended = error
        failure = str(error) or "interrupted"
    made = provenance_of(model, base, session.sources, datetime.now(UTC))
    save_learned(out / "learned.npz", loop.best_of(done).correction, base)
    commands = list(_next_commands(spec, model, driven, out))
    write = partial(_write, out, done, made, commands, failure=failure, figures=figures)
    write(taught=None)
    show(learning_text(done))
    if diagnosed and not failure:
        taught = _taught(base, done, out, made)
        write(taught=taught)
        show(taught_text(taught))
    say(f"Report: {out / 'report.html'}. Correction: {out / 'learned.npz'}.")
    if isinstance(ended, KeyboardInterrupt):
        raise ended
    if failure:
        raise ScanError(f"learning ended after {len(done)} scans: {failure}")


def _taught(
    model: ScannerModel, done: list[loop.LearningScan], out: Path, of: Provenance
) -> Taught:
    """Diagnose the first scan and the learned one together."""
    with working("diagnosing") as progress:
        found = diagnose(model, loop.observations(done), progress)
    best = loop.best_of(done)
    head = f"{HEADING}\n{heading_lines(of)}"
    save_model(out / "model.extended.yaml", found.model, head)
    return Taught(found, loop.lacking(model, best), loop.lacking(found.model, best))


def _next_commands(
    spec: Path, model: Path, driven: DrivenScanner, out: Path
) -> Iterator[CommandLine]:
    files = ["--spec", spec, "--model", model, *driven.options]
    yield CommandLine(
        "Make the same scan with the correction.",
        ["scan", *files, "--learned", out / "learned.npz", "--bag", out / "bags/learned"],
    )
    yield CommandLine(
        "Find out which effect the model lacks, so that other scans are better too.",
        ["learn", *files, "--diagnose", "--out", out.with_name(f"{out.name}_diagnosed")],
    )


def _write(
    out: Path,
    done: list[loop.LearningScan],
    of: Provenance,
    commands: Iterable[CommandLine],
    *,
    taught: Taught | None,
    failure: str,
    figures: str | None,
) -> None:
    """Write what was learned; ``failure`` is what ended it, if any."""
    document = {**learning_document(done, taught), "failure": failure, "provenance": plain(of)}
    save_diagnosis(out / "learning.json", document)
    with working("writing the report", at_once=False):
        learning_report(done, taught, of, commands, failure).write(out / "report.html", figures)
