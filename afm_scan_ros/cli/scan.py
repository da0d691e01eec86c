"""``afm-scan scan``: one scan by separate processes, recorded in a bag."""

import math
from pathlib import Path

import click
from attrs import frozen

from afm_scan_ros.cli.domain import isolate
from afm_scan_ros.cli.processes import NodeCommand, run_nodes
from afm_scan_ros.cli.progress import watching
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.model import INVERSES
from afm_scan_ros.files.model_file import load_model
from afm_scan_ros.files.plant_file import load_plant
from afm_scan_ros.files.scan_file import load_scan
from afm_scan_ros.files.share import share_directory
from afm_scan_ros.nodes.block_source import FLOW
from afm_scan_ros.nodes.parameters import inverses_of

CONFIG = share_directory() / "config"


@frozen
class ScanFiles:
    """What a scan is made from, and the folder of the bag that it ends in."""

    spec: Path
    model: Path
    plant: Path
    bag: Path


def run_scan(
    files: ScanFiles,
    inverses: tuple[str, ...],
    time_scale: float | None = None,
    seed: int | None = None,
) -> None:
    """Run one scan as the file says, by default as fast as the slowest node allows.

    ``seed`` is that of the sensor's noise, by default the configured one. Raises InputError
    before it begins, ScanError where it stays incomplete.
    """
    if files.bag.exists():
        raise InputError(f"{files.bag} exists already: give another folder or remove it")
    load_model(files.model)
    load_plant(files.plant)
    inverses_of(inverses, INVERSES)
    _, others = load_scan(files.spec, [parameter.name for parameter in FLOW])
    if time_scale is None:
        time_scale = float(others.get("time_scale", 0.0))
    if not 0.0 <= time_scale < math.inf:
        raise InputError(f"time_scale = {time_scale:g}: give 1 for real time, 0 for no pacing")
    isolate()
    with watching(f"scan to {files.bag}") as idle:
        run_nodes(_commands(files, list(inverses), time_scale, seed), idle)


def _commands(
    files: ScanFiles, inverses: list[str], time_scale: float, seed: int | None
) -> list[NodeCommand]:
    model: dict[str, object] = {"model_file": str(files.model), "inverses": inverses}
    source = {
        "required_nodes": [
            "inversion_compensator",
            "piezoscanner_sim",
            "tracking_monitor",
            "scan_recorder",
        ],
        "min_subscriptions": 3,
        "time_scale": time_scale,
    }
    noise = {} if seed is None else {"seed": seed}
    scanner = {"plant_file": str(files.plant), "min_subscriptions": 2} | noise
    return [
        NodeCommand("scan_recorder", {"bag": str(files.bag)}, CONFIG / "scan_recorder.yaml"),
        NodeCommand("tracking_monitor", {"min_subscriptions": 1}),
        NodeCommand("piezoscanner_sim", scanner, CONFIG / "piezoscanner_sim.yaml"),
        NodeCommand("inversion_compensator", model, CONFIG / "inversion_compensator.yaml"),
        NodeCommand("trajectory_generator", model | source, files.spec),
    ]


_FILE = click.Path(dir_okay=False, path_type=Path)


@click.command()
@click.option("--spec", type=_FILE, default=CONFIG / "scan.yaml", help="Scan to make.")
@click.option("--model", type=_FILE, default=CONFIG / "model.yaml", help="What is inverted.")
@click.option("--plant", type=_FILE, default=CONFIG / "plant.yaml", help="What is simulated.")
@click.option(
    "--inverses",
    default=",".join(INVERSES),
    show_default=True,
    help="Effects to invert, with commas between; or none.",
)
@click.option("--time-scale", type=float, help="1 for real time, 0 as fast as possible.")
@click.option(
    "--bag",
    required=True,
    type=click.Path(path_type=Path),
    help="Folder to make for the bag.",
)
def scan(
    spec: Path, model: Path, plant: Path, inverses: str, time_scale: float | None, bag: Path
) -> None:
    """Make one scan and record it."""
    run_scan(
        ScanFiles(spec, model, plant, bag),
        tuple(name.strip() for name in inverses.split(",")),
        time_scale,
    )
    click.echo(f"{bag} is recorded.")
