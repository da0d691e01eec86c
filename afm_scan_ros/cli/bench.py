"""``afm-scan bench``: the package's figures of accuracy, measured anew."""

import importlib
from pathlib import Path

import click

QUICK = (
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
    "play",
    "reach",
)
MEASURED = (
    "forc",
    "manipulator",
    "manipulator_tracing",
    "fsm",
    "fsm_modes",
    "fsm_noise",
    "fsm_extended",
    "fsm_rivals",
)
SPEED = ("speed", "pipes", "bags", "memory", "startup")
LONG = (
    "coverage",
    "chain_coverage",
    "mechanisms",
    "closed_loop",
    "faults",
    "soak",
    "speed_diagnosis",
)
LONGEST = ("diagnosis", "diagnosis_kinds", "diagnosis_images", "diagnosis_healthy")

GROUPS = {
    "run without a name: a minute or less each, some five together": QUICK,
    "of measurements in the folder AFM_SCAN_DATA, some minutes each": MEASURED,
    "of speed and size, some minutes each, with nothing else running": SPEED,
    "many minutes each": LONG,
    "an hour together, on two cores": LONGEST,
}
"""Benches by how long one core takes; each is the module of its name in ``afm_scan_ros.bench``."""


def _groups() -> str:
    """Each group, as click prints a list."""
    return "\n\n".join(
        f"{said[0].upper()}{said[1:]}: {', '.join(g)}." for said, g in GROUPS.items()
    )


@click.command(epilog=_groups())
@click.argument(
    "names",
    nargs=-1,
    type=click.Choice([name for group in GROUPS.values() for name in group]),
    metavar="[NAME]...",
)
@click.option(
    "--out",
    type=click.Path(file_okay=False, path_type=Path),
    help="Folder for each table as JSON and each curve as a picture.",
)
def bench(names: tuple[str, ...], out: Path | None) -> None:
    """Measure the figures NAMES; without a name, those that are quick."""
    for name in names or QUICK:
        table = importlib.import_module(f"afm_scan_ros.bench.{name}").measure()
        table.show()
        if out is not None:
            table.save(out)
