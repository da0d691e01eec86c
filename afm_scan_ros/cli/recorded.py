"""``afm-scan analyze`` and ``diagnose``: what recorded scans show."""

import json
from collections.abc import Iterator, Mapping
from pathlib import Path

import click
import numpy as np

from afm_scan_ros import diagnosis as api
from afm_scan_ros.bag.reader import read_scan
from afm_scan_ros.cli import options
from afm_scan_ros.cli.progress import working
from afm_scan_ros.core.diagnosis.experiments import LONGEST
from afm_scan_ros.core.errors import ScanError
from afm_scan_ros.core.metrics import plain, sensor_doubt
from afm_scan_ros.core.record import Record
from afm_scan_ros.core.types import AXES
from afm_scan_ros.files.paths import write_text
from afm_scan_ros.model import load_model
from afm_scan_ros.report.analysis import AxisComparison, Comparison, analyse, comparable, compare
from afm_scan_ros.report.quantity import nanometres
from afm_scan_ros.report.scan_pictures import tracking_picture, view_of
from afm_scan_ros.report.scan_report import error_tables, scan_report, scan_rows
from afm_scan_ros.report.table import Rows, show
from afm_scan_ros.report.terminal import say


@click.command()
@click.argument("bag", type=options.RECORD)
@click.option("--json", "json_file", type=options.NEW_FILE, help="Write all numbers as JSON.")
@click.option("--report", type=options.NEW_FILE, help="Write a report as one HTML file.")
@click.option(
    "--figure",
    type=options.NEW_FILE,
    help="Write the figure; the suffix gives the format: .png, .svg, .pdf.",
)
@options.FIGURES
@options.topic_option
def analyze(
    bag: Path,
    json_file: Path | None,
    report: Path | None,
    figure: Path | None,
    figures: str | None,
    topics: Mapping[str, str],
) -> None:
    """Compare desired with achieved displacement in BAG, a rosbag2 folder or an .mcap file."""
    if figures is not None and report is None:
        raise click.UsageError("--figures are written beside a report: give --report")
    options.refuse_over(bag, json_file, report, figure)
    with working("analysing", at_once=False):
        recording = read_scan(bag, topics)
        alone = comparable(recording) and report is None and figure is None
        found = compare(recording) if alone else analyse(recording)
    if isinstance(found, Comparison):
        options.warn(recording.warnings)
        _show_comparison(found, json_file)
        return
    analysis = found
    options.warn(analysis.warnings)
    show([Rows((), scan_rows(analysis)), *error_tables(analysis)])
    if json_file is not None:
        write_text(json_file, json.dumps(plain(analysis), indent=2) + "\n")
    if report is not None:
        with working("writing the report", at_once=False):
            scan_report(analysis, recording).write(report, figures)
    if figure is not None:
        from afm_scan_ros.report.paper import paper_figure, save  # noqa: PLC0415 - by matplotlib

        title = f"Scan {analysis.name}"
        save(paper_figure(tracking_picture(view_of(recording), title)), figure)
    if analysis.shortcomings:
        raise ScanError("; ".join(analysis.shortcomings))


def _show_comparison(found: Comparison, json_file: Path | None) -> None:
    say(f"{found.bag}: {found.samples} samples of a record '{found.record}'")
    for axis in AXES:
        error: AxisComparison | None = getattr(found, axis)
        if error is not None:
            say(
                f"{axis}: achieved minus desired: rms {nanometres(error.rms)} nm, peak"
                f" {nanometres(error.largest)} nm; mean {nanometres(error.mean)} nm, standard"
                f" deviation {nanometres(error.spread)} nm; desired peak-to-peak"
                f" {nanometres(error.peak_to_peak)} nm"
            )
    if json_file is not None:
        write_text(json_file, json.dumps(plain(found), indent=2) + "\n")


@click.command()
@click.argument("bags", nargs=-1, required=True, type=options.RECORD, metavar="BAG...")
@click.option(
    "--model",
    required=True,
    type=options.FILE,
    help="Model file of the scanner, with its model discrepancy (model_discrepancy).",
)
@click.option(
    "--healthy",
    multiple=True,
    type=options.RECORD,
    metavar="RECORD",
    help="Record of the scanner while it was healthy, as an ordinary scan. It adds the model's"
    " error on such motion. May be given several times.",
)
@click.option(
    "--out",
    required=True,
    type=options.FOLDER,
    help="Folder for diagnosis.json, model.extended.yaml, report.html.",
)
@click.option(
    "--longest",
    type=options.positive("s"),
    default=f"{LONGEST:g}s",
    show_default=True,
    help="Length of the proposed experiment, at most.",
)
@click.option(
    "--structure",
    is_flag=True,
    help="Ask what the structure of the model lacks, and not what has changed since it was"
    " identified: its stated error then explains nothing.",
)
@options.FIGURES
@options.record_options
def diagnose(  # noqa: PLR0913 - click hands over one parameter an option
    bags: tuple[Path, ...],
    model: Path,
    healthy: tuple[Path, ...],
    out: Path,
    longest: float,
    tables: options.TableOptions,
    *,
    structure: bool,
    figures: str | None,
) -> None:
    """Identify the effect that a model lacks, from the residual of records.

    A BAG is a rosbag2 folder or an .mcap file with drive_voltage and achieved_displacement, or a
    table of drive and displacement. Of coupled axes each is a realisation, as for 'identify'.
    """
    options.refuse_existing(out / "diagnosis.json")
    base = load_model(model)
    records, well = ([tables.read(bag) for bag in some] for some in (bags, healthy))
    with working("diagnosing") as progress:
        found = api.diagnose(base, records, well, progress, longest, structure=structure)
        progress("describing the residual")
        found.save(out, figures)
    for record in (*records, *well):
        options.warn(_doubts(record))
    show(found.summary)
    say(f"Report: {out / 'report.html'}. JSON and extended model are beside it.")


def _doubts(record: Record) -> Iterator[str]:
    """Yield a sentence for each axis whose sensor shows nothing, or what no scanner does."""
    driven = np.ptp(record.drive, axis=0)
    coupled = len(driven) != len(record.axes)
    for number, (axis, moved) in enumerate(zip(record.axes, record.displacement.T, strict=True)):
        extent = driven.max() if coupled else driven[number]
        if doubt := sensor_doubt(axis, extent, moved.min(), moved.max()):
            yield f"{record.name}: {doubt}"
