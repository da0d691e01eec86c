"""``afm-scan analyze``: desired against achieved displacement of a recorded scan."""

import json
from pathlib import Path

import click

from afm_scan_ros.bag.reader import ScanRecording, read_scan
from afm_scan_ros.core.errors import ScanError
from afm_scan_ros.core.metrics import plain
from afm_scan_ros.core.types import AXES
from afm_scan_ros.report.analysis import (
    Analysis,
    AxisComparison,
    Comparison,
    analyse,
    comparable,
    compare,
)
from afm_scan_ros.report.quantity import nanometres
from afm_scan_ros.report.scan_figures import save, tracking_figure, view_of
from afm_scan_ros.report.scan_report import HEADINGS, error_rows, scan_report, scan_rows
from afm_scan_ros.report.table import show_rows

_FILE = click.Path(dir_okay=False, path_type=Path)


def _in_folder(ctx: click.Context, param: click.Parameter, value: Path | None) -> Path | None:
    """Refuse a file whose folder is missing, before anything is computed."""
    if value is not None and not value.parent.is_dir():
        raise click.BadParameter(f"there is no folder {value.parent}: make it first", ctx, param)
    return value


@click.command()
@click.argument("bag", type=click.Path(path_type=Path))
@click.option(
    "--json", "json_file", type=_FILE, callback=_in_folder, help="Write all numbers as JSON."
)
@click.option("--report", type=_FILE, callback=_in_folder, help="Write a report as one HTML file.")
@click.option(
    "--figure",
    type=_FILE,
    callback=_in_folder,
    help="Write the figure; the suffix gives the format: .png, .svg, .pdf.",
)
def analyze(bag: Path, json_file: Path | None, report: Path | None, figure: Path | None) -> None:
    """Compare desired with achieved displacement in BAG, a rosbag2 folder or an .mcap file."""
    recording = read_scan(bag)
    if comparable(recording) and report is None and figure is None:
        compared = compare(recording)
        _warn(recording)
        _show_comparison(compared, json_file)
        return
    analysis = analyse(recording)
    _warn(recording)
    _show(analysis)
    if json_file is not None:
        json_file.write_text(json.dumps(plain(analysis), indent=2) + "\n", "utf-8")
    if report is not None:
        report.write_text(scan_report(analysis, view_of(recording)), "utf-8")
    if figure is not None:
        save(tracking_figure(view_of(recording), f"Scan {analysis.scan.scan_id}"), figure)
    if analysis.shortcomings:
        raise ScanError("; ".join(analysis.shortcomings))


def _warn(recording: ScanRecording) -> None:
    """Print what is missing; where nothing could be read, the error states it."""
    for warning in recording.warnings:
        click.echo(f"warning: {warning}", err=True)


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


def _show(analysis: Analysis) -> None:
    show_rows((), scan_rows(analysis))
    for tracking in (analysis.true, analysis.measured):
        if tracking is not None:
            title = f"Error of the {tracking.displacement} displacement"
            show_rows(HEADINGS, error_rows(tracking), title)
