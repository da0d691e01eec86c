"""``afm-scan bench``: the package's figures of accuracy, measured anew."""

import importlib
from pathlib import Path

import click

BENCHES = (
    "plant",
    "creep",
    "hysteresis",
    "ramp_rate",
    "hold",
    "preview",
    "tracking",
    "mismatch",
    "robustness",
    "record_length",
    "table1",
    "tradeoff",
    "vibration",
    "order",
    "delay",
    "coverage",
    "chain_coverage",
    "forc",
    "manipulator",
    "manipulator_tracing",
    "fsm",
    "fsm_modes",
    "fsm_noise",
    "fsm_extended",
    "fsm_rivals",
    "mechanisms",
    "diagnosis",
    "diagnosis_healthy",
    "faults",
)


@click.command()
@click.argument("names", nargs=-1, type=click.Choice(BENCHES))
@click.option(
    "--out",
    type=click.Path(file_okay=False, path_type=Path),
    help="Folder for each table as JSON and each curve as a picture.",
)
def bench(names: tuple[str, ...], out: Path | None) -> None:
    """Measure the figures NAMES (all without a name) on the default plant and model."""
    for name in names or BENCHES:
        table = importlib.import_module(f"afm_scan_ros.bench.{name}").measure()
        table.show()
        if out is not None:
            table.save(out)
