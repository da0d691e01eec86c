"""``afm-scan analyze``: desired against achieved displacement of a recorded scan."""

import json
from pathlib import Path

import click
from rich.console import Console
from rich.table import Table

from afm_scan_ros.bag.reader import ScanRecording, read_scan
from afm_scan_ros.core.errors import ScanError
from afm_scan_ros.core.metrics import Tracking, plain
from afm_scan_ros.core.types import AXES
from afm_scan_ros.report.analysis import Analysis, analyse
from afm_scan_ros.report.comparison import AxisComparison, Comparison, comparable, compare
from afm_scan_ros.report.figures import save, tracking_figure
from afm_scan_ros.report.scan_report import scan_report
from afm_scan_ros.report.tables import HEADINGS, error_rows, nanometres, scan_rows
from afm_scan_ros.report.view import view_of

_FILE = click.Path(dir_okay=False, path_type=Path)


@click.command()
@click.argument("bag", type=click.Path(path_type=Path))
@click.option("--json", "json_file", type=_FILE, help="Write all figures as JSON.")
@click.option("--report", type=_FILE, help="Write a report as one HTML file.")
@click.option("--figure", type=_FILE, help="Write the picture, as its ending says: .png, .svg.")
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
    """Say what is missing; where nothing could be read, the error says it instead."""
    for warning in recording.warnings:
        click.echo(f"warning: {warning}", err=True)


def _show_comparison(found: Comparison, json_file: Path | None) -> None:
    click.echo(f"{found.bag}: {found.samples} samples of a record '{found.record}'")
    for axis in AXES:
        error: AxisComparison | None = getattr(found, axis)
        if error is not None:
            click.echo(
                f"{axis}: achieved less desired: rms {nanometres(error.rms)} nm, largest"
                f" {nanometres(error.largest)} nm; mean {nanometres(error.mean)} nm, about it"
                f" {nanometres(error.spread)} nm; desired {nanometres(error.peak_to_peak)} nm"
                " peak to peak"
            )
    if json_file is not None:
        json_file.write_text(json.dumps(plain(found), indent=2) + "\n", "utf-8")


def _show(analysis: Analysis) -> None:
    console = Console()
    about = Table(box=None, show_header=False)
    for row in scan_rows(analysis):
        about.add_row(*row)
    console.print(about)
    for tracking in (analysis.true, analysis.measured):
        if tracking is not None:
            console.print(_errors(tracking))


def _errors(tracking: Tracking) -> Table:
    table = Table(title=f"Error of the {tracking.displacement} displacement", title_justify="left")
    for heading in HEADINGS:
        table.add_column(heading, justify="right" if heading else "left")
    for row in error_rows(tracking):
        table.add_row(*row)
    return table
