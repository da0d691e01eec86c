"""``afm-scan demo``: the whole chain, without and with compensation."""

import shutil
from collections.abc import Iterator
from pathlib import Path

import click

from afm_scan_ros.bag.reader import read_scan
from afm_scan_ros.cli.execution import how_scans_run
from afm_scan_ros.cli.options import CONFIG, FIGURE_FORMATS, FOLDER
from afm_scan_ros.cli.orders import ScanFiles
from afm_scan_ros.cli.scan import run_scan
from afm_scan_ros.core.model import INVERSES
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.files.plant_file import save_scan
from afm_scan_ros.report.analysis import analyse, scan_spec
from afm_scan_ros.report.page import CommandLine
from afm_scan_ros.report.scan_pictures import (
    WITH,
    WITHOUT,
    Images,
    ScanExcerpt,
    TwoScans,
    comparison_picture,
    images_of,
    view_of,
)
from afm_scan_ros.report.scan_report import DemoScan, Scanned, contributions, demo_report, tracking

SAMPLES_AND_TURNAROUND = {5.0: (4_000, 0.1), 30.0: (1_000, 0.1), 100.0: (500, 0.2)}
"""Samples per line and share of a line for turning round, at each line rate (Hz)."""

LINE_RATES = tuple(SAMPLES_AND_TURNAROUND)
LINES = 6
SHARED_RATE = 30.0
"""The line rate at which each inverse also scans alone and is left out."""
IMAGE_LINES = 64
"""Lines of the two scans at that rate that image a grating."""


def cases() -> Iterator[DemoScan]:
    """All scans: none and all at each line rate, and the inverses one by one at one of them."""
    for rate in LINE_RATES:
        yield DemoScan(rate, "none", ("none",), LINES)
        yield DemoScan(rate, "all", INVERSES, LINES)
    for inverse in INVERSES:
        yield DemoScan(SHARED_RATE, f"{inverse} alone", (inverse,), LINES)
        others = tuple(name for name in INVERSES if name != inverse)
        yield DemoScan(SHARED_RATE, f"all but {inverse}", others, LINES)
    yield from IMAGED


IMAGED = (
    DemoScan(SHARED_RATE, "image none", ("none",), IMAGE_LINES),
    DemoScan(SHARED_RATE, "image all", INVERSES, IMAGE_LINES),
)
"""The scans that image a grating, without and with compensation."""


@click.command()
@click.option(
    "--out",
    type=FOLDER,
    default="demo",
    show_default=True,
    help="Folder for bags, tables and report.",
)
@click.option(
    "--figures",
    type=FIGURE_FORMATS,
    default="png",
    show_default=True,
    help="Format of the figures beside the report.",
)
def demo(out: Path, figures: str) -> None:
    """Scan a simulated scanner without and with compensation, and compare the errors.

    The scanner is config/plant.yaml. The model is config/model.yaml, identified from simulated
    records of that scanner.
    """
    every, ran = list(cases()), how_scans_run()
    click.echo(f"{len(every)} scans {ran}", err=True)
    done: Scanned = {}
    for number, case in enumerate(every, 1):
        click.echo(f"scan {number} of {len(every)}: {case.line_rate:g} Hz, {case.name}", err=True)
        done[case] = analyse(read_scan(_scan(case, out)))
    tables = (tracking(done), contributions(done, SHARED_RATE))
    for table in tables:
        table.show()
        table.save(out)
    compared = {
        rate: comparison_picture(f"{rate:g}hz", *_views(rate, out), f"{rate:g} Hz")
        for rate in LINE_RATES
    }
    made = demo_report(tables, compared, (IMAGED[0], _images(out)), next_commands(out), ran)
    made.write(out / "report.html", figures)
    click.echo(f"Report: {out / 'report.html'}. Figures, bags and JSON are in the same folder.")


def next_commands(out: Path) -> Iterator[CommandLine]:
    """Yield what to do after the demonstration."""
    calibration, plant = out / "calibration", CONFIG / "plants/delay_medium.yaml"
    records = ("creep", "frequency", "hysteresis", "validation")
    bags = [word for kind in records for word in (f"--{kind}", calibration / kind)]
    yield CommandLine(
        "See all errors of one scan.",
        ["analyze", out / "bags/30hz_all", "--report", out / "scan.html"],
    )
    yield CommandLine("Record the identification drives.", ["calibrate", "--out", calibration])
    yield CommandLine(
        "Identify a model from them.", ["identify", *bags, "--out", out / "model.yaml"]
    )
    yield CommandLine(
        "Find an effect that the model lacks, and compensate it.",
        ["close-loop", "--plant", plant, "--out", out / "loop"],
    )
    yield CommandLine("Import a measured record of your own scanner.", ["import-csv", "--help"])


def _scan(case: DemoScan, out: Path) -> Path:
    """Scan into a new bag, in place of one that an earlier demonstration left."""
    bag = out / "bags" / case.stem
    if (bag / "metadata.yaml").exists():
        shutil.rmtree(bag)
    spec = out / "specs" / f"{case.stem}.yaml"
    samples, turnaround = SAMPLES_AND_TURNAROUND[case.line_rate]
    scanned = ScanSpec(
        lines=case.lines, line_rate=case.line_rate, samples_per_line=samples, turnaround=turnaround
    )
    save_scan(spec, scanned, "A scan of the demonstration.")
    files = ScanFiles(spec, CONFIG / "model.yaml", CONFIG / "plant.yaml", bag)
    run_scan(files, case.inverses, images=True)
    return bag


def _views(rate: float, out: Path) -> tuple[ScanExcerpt, ScanExcerpt]:
    none, every = (out / "bags" / f"{rate:g}hz_{name}" for name in ("none", "all"))
    return view_of(read_scan(none)), view_of(read_scan(every))


def _images(out: Path) -> Images:
    without, compensated = (read_scan(out / "bags" / scan.stem) for scan in IMAGED)
    desired = without.whole("desired_displacement")
    achieved = without.whole("true_displacement"), compensated.whole("true_displacement")
    return images_of(TwoScans(scan_spec(without), desired, achieved, "true", (WITHOUT, WITH)))
