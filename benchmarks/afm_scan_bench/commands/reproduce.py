"""``afm-scan reproduce``: the paper's tables and figures, made anew, beside its own."""

import importlib
import json
from collections.abc import Iterator
from pathlib import Path

import click
from rich.console import Console
from rich.progress import track

from afm_scan_bench.paper.page import HEADINGS, document, page
from afm_scan_bench.paper.section import Section
from afm_scan_ros.report.paper import save
from afm_scan_ros.report.table import Rows

IMAGES = ("figure_9", "figure_10", "figure_11")
SECTIONS = ("table_1", "figure_5", "figure_6", "figure_8", *IMAGES, "figure_12")


@click.command()
@click.argument("names", nargs=-1, type=click.Choice(SECTIONS))
@click.option(
    "--out",
    type=click.Path(file_okay=False, path_type=Path),
    default="reproduce",
    show_default=True,
    help="Folder for the report, its numbers and its figures.",
)
@click.option(
    "--lines",
    type=click.IntRange(min=16),
    default=128,
    show_default=True,
    help="Lines in each image.",
)
def reproduce(names: tuple[str, ...], out: Path, lines: int) -> None:
    """Make the tables and figures NAMES (all without a name) of the paper anew.

    The scanner is that of config/plant.yaml, the model config/model.yaml.
    """
    done = list(_sections(names or SECTIONS, lines))
    out.mkdir(parents=True, exist_ok=True)
    for section in done:
        for drawn in section.pictures:
            save(drawn.figure, out / f"{section.name}_{drawn.name}.png")
    (out / "reproduce.json").write_text(json.dumps(document(done), indent=2) + "\n", "utf-8")
    (out / "report.html").write_text(page(done), "utf-8")
    for section in done:
        Rows(HEADINGS, [row.row() for row in section.compared], section.title).show()
    click.echo(f"Report: {out / 'report.html'}. Figures and JSON are in the same folder.")


def _sections(names: tuple[str, ...], lines: int) -> Iterator[Section]:
    console = Console(stderr=True)
    for name in track(names, "the paper's results", console=console, transient=True):
        module = importlib.import_module(f"afm_scan_bench.paper.{name}")
        yield module.section(lines) if name in IMAGES else module.section()
