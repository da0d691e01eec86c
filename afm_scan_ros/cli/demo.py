"""``afm-scan demo``: the whole chain as separate processes, without and with compensation."""

import shutil
from collections.abc import Iterator
from pathlib import Path

import click

from afm_scan_ros.bag.reader import read_scan
from afm_scan_ros.cli.scan import CONFIG, ScanFiles, run_scan
from afm_scan_ros.core.model import INVERSES
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.files import yaml
from afm_scan_ros.files.records import to_mapping
from afm_scan_ros.report.analysis import analyse
from afm_scan_ros.report.demo_page import DemoScan, Scanned, contributions, report, tracking
from afm_scan_ros.report.scan_figures import ScanExcerpt, comparison_figure, save, view_of

SAMPLES_AND_TURNAROUND = {5.0: (4_000, 0.1), 30.0: (1_000, 0.1), 100.0: (500, 0.2)}
"""Samples per line and share of a line for turning round, at each line rate (Hz)."""

LINE_RATES = tuple(SAMPLES_AND_TURNAROUND)
LINES = 6
SHARED_RATE = 30.0
"""The line rate at which each inverse also scans alone and is left out."""


def cases() -> Iterator[DemoScan]:
    """All scans: none and all at each line rate, and the inverses one by one at one of them."""
    for rate in LINE_RATES:
        yield DemoScan(rate, "none", ("none",))
        yield DemoScan(rate, "all", INVERSES)
    for inverse in INVERSES:
        yield DemoScan(SHARED_RATE, f"{inverse} alone", (inverse,))
        others = tuple(name for name in INVERSES if name != inverse)
        yield DemoScan(SHARED_RATE, f"all but {inverse}", others)


@click.command()
@click.option(
    "--out",
    type=click.Path(file_okay=False, path_type=Path),
    default="demo",
    show_default=True,
    help="Folder for bags, figures and report.",
)
def demo(out: Path) -> None:
    """Scan a simulated scanner without and with compensation, and show what that does.

    The scanner is that of config/plant.yaml; the model, config/model.yaml, is what calibration
    made of it.
    """
    every = list(cases())
    done: Scanned = {}
    for number, case in enumerate(every, 1):
        click.echo(f"scan {number} of {len(every)}: {case.line_rate:g} Hz, {case.name}", err=True)
        done[case] = analyse(read_scan(_scan(case, out)))
    tables = (tracking(done), contributions(done, SHARED_RATE))
    for table in tables:
        table.show()
        table.save(out)
    figures = {rate: comparison_figure(*_views(rate, out)) for rate in LINE_RATES}
    for rate, figure in figures.items():
        save(figure, out / f"comparison_{rate:g}hz.png")
    (out / "report.html").write_text(report(tables, figures), "utf-8")
    click.echo(f"{out / 'report.html'} shows it all; bags, figures and JSON are beside it.")


def _scan(case: DemoScan, out: Path) -> Path:
    """Scan into a new bag, in place of one that an earlier demonstration left."""
    bag = out / "bags" / case.stem
    if (bag / "metadata.yaml").exists():
        shutil.rmtree(bag)
    spec = out / "specs" / f"{case.line_rate:g}hz.yaml"
    spec.parent.mkdir(parents=True, exist_ok=True)
    samples, turnaround = SAMPLES_AND_TURNAROUND[case.line_rate]
    scanned = ScanSpec(
        lines=LINES,
        line_rate=case.line_rate,
        samples_per_line=samples,
        turnaround=turnaround,
    )
    parameters = to_mapping(scanned)
    section = {"/**/trajectory_generator": {"ros__parameters": parameters}}
    yaml.save(spec, section, "A scan of the demonstration.")
    files = ScanFiles(spec, CONFIG / "model.yaml", CONFIG / "plant.yaml", bag)
    run_scan(files, case.inverses, shown=True)
    return bag


def _views(rate: float, out: Path) -> tuple[ScanExcerpt, ScanExcerpt]:
    none, every = (out / "bags" / f"{rate:g}hz_{name}" for name in ("none", "all"))
    return view_of(read_scan(none)), view_of(read_scan(every))
