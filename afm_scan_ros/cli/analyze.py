"""``afm-scan analyze``: desired against achieved displacement of a recorded scan."""

import json
from collections.abc import Mapping
from pathlib import Path

import click

from afm_scan_ros.bag.reader import read_scan
from afm_scan_ros.cli.options import FILE, RECORD, warn
from afm_scan_ros.cli.tables import topic_option
from afm_scan_ros.core.errors import ScanError
from afm_scan_ros.core.metrics import plain
from afm_scan_ros.core.types import AXES
from afm_scan_ros.report.analysis import AxisComparison, Comparison, analyse, comparable, compare
from afm_scan_ros.report.quantity import nanometres
from afm_scan_ros.report.scan_figures import save, tracking_figure, view_of
from afm_scan_ros.report.scan_report import error_tables, scan_report, scan_rows
from afm_scan_ros.report.table import Rows, show


def _in_folder(ctx: click.Context, param: click.Parameter, value: Path | None) -> Path | None:
    """Refuse a file whose folder is missing, before anything is computed."""
    if value is not None and not value.parent.is_dir():
        raise click.BadParameter(f"there is no folder {value.parent}: make it first", ctx, param)
    return value


@click.command()
@click.argument("bag", type=RECORD)
@click.option(
    "--json", "json_file", type=FILE, callback=_in_folder, help="Write all numbers as JSON."
)
@click.option("--report", type=FILE, callback=_in_folder, help="Write a report as one HTML file.")
@click.option(
    "--figure",
    type=FILE,
    callback=_in_folder,
    help="Write the figure; the suffix gives the format: .png, .svg, .pdf.",
)
@topic_option
def analyze(
    bag: Path,
    json_file: Path | None,
    report: Path | None,
    figure: Path | None,
    topics: Mapping[str, str],
) -> None:
    """Compare desired with achieved displacement in BAG, a rosbag2 folder or an .mcap file."""
    recording = read_scan(bag, topics)
    if comparable(recording) and report is None and figure is None:
        compared = compare(recording)
        warn(recording.warnings)
        _show_comparison(compared, json_file)
        return
    analysis = analyse(recording)
    warn(recording.warnings)
    show([Rows((), scan_rows(analysis)), *error_tables(analysis)])
    if json_file is not None:
        json_file.write_text(json.dumps(plain(analysis), indent=2) + "\n", "utf-8")
    if report is not None:
        report.write_text(scan_report(analysis, view_of(recording)), "utf-8")
    if figure is not None:
        save(tracking_figure(view_of(recording), f"Scan {analysis.scan.scan_id}"), figure)
    if analysis.shortcomings:
        raise ScanError("; ".join(analysis.shortcomings))


def _show_comparison(found: Comparison, json_file: Path | None) -> None:
    click.echo(f"{found.bag}: {found.samples} samples of a record '{found.record}'")
    for axis in AXES:
        error: AxisComparison | None = getattr(found, axis)
        if error is not None:
            click.echo(
                f"{axis}: achieved minus desired: rms {nanometres(error.rms)} nm, peak"
                f" {nanometres(error.largest)} nm; mean {nanometres(error.mean)} nm, standard"
                f" deviation {nanometres(error.spread)} nm; desired peak-to-peak"
                f" {nanometres(error.peak_to_peak)} nm"
            )
    if json_file is not None:
        json_file.write_text(json.dumps(plain(found), indent=2) + "\n", "utf-8")
