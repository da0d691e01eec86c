"""``afm-scan bench``: the package's figures of accuracy, measured anew."""

import importlib
from collections.abc import Mapping
from itertools import chain
from pathlib import Path

import click

QUICK = {
    "accuracy": (
        "plant",
        "creep",
        "hysteresis",
        "hold",
        "preview",
        "tracking",
        "mismatch",
        "robustness",
        "table1",
        "tradeoff",
        "play",
        "reach",
    ),
    "learning": ("line_feedback",),
}
MEASURED = {
    "measured": (
        "forc",
        "manipulator",
        "fsm",
        "fsm_modes",
        "fsm_noise",
        "fsm_extended",
        "fsm_competing",
        "fsm_diagnosed",
        "silverbox",
    )
}
SPEED = {
    "speed": ("speed", "speed_inverses", "pipes", "bags", "memory", "startup"),
    "learning": ("learning_speed",),
    "survey": ("survey_speed",),
}
LONG = {
    "accuracy": (
        "chain_coverage",
        "families",
        "small_scans",
        "from_scans",
        "planned",
        "random_levels",
        "scanners",
    ),
    "diagnosis": (
        "mechanisms",
        "closed_loop",
        "external",
        "healthy_bands",
        "laplace",
        "rivals",
        "tones",
    ),
    "any_lab": ("any_lab", "joint_fit"),
    "images": ("grating",),
    "learning": (
        "learning",
        "learning_effects",
        "learning_noise",
        "learning_drawn",
        "learning_rivals",
        "learning_transfer",
        "adaptation",
        "adapted_inverse",
    ),
    "faults": ("faults", "drive", "viewers", "live_view", "real_time", "soak"),
    "speed": ("speed_diagnosis",),
    "survey": ("survey",),
}
LONGEST = {
    "any_lab": ("diagnosis",),
    "diagnosis": ("diagnosis_plants", "diagnosis_kinds", "diagnosis_images", "diagnosis_healthy"),
}

GROUPS: dict[str, Mapping[str, tuple[str, ...]]] = {
    "run without a name: a minute or less each, one or two together": QUICK,
    "of measurements in the folder AFM_SCAN_DATA, some minutes each": MEASURED,
    "of speed and size, some minutes each, with nothing else running": SPEED,
    "many minutes each": LONG,
    "hours together, on two cores": LONGEST,
}
"""Benches by how long one core takes; the keys within a group are folders of this package."""

MODULES = {
    name: f"afm_scan_bench.{folder}.{name}"
    for group in GROUPS.values()
    for folder, names in group.items()
    for name in names
}


def _groups() -> str:
    """Each group, as click prints a list."""
    lists = {
        group_name: chain.from_iterable(group.values()) for group_name, group in GROUPS.items()
    }
    return "\n\n".join(
        f"{group_name[0].upper()}{group_name[1:]}: {', '.join(names)}."
        for group_name, names in lists.items()
    )


@click.command(epilog=_groups())
@click.argument(
    "names",
    nargs=-1,
    type=click.Choice(list(MODULES)),
    metavar="[NAME]...",
)
@click.option(
    "--out",
    type=click.Path(file_okay=False, path_type=Path),
    help="Folder for each table as JSON and each curve as a picture.",
)
def bench(names: tuple[str, ...], out: Path | None) -> None:
    """Measure the figures NAMES; without a name, those that are quick."""
    for name in names or chain.from_iterable(QUICK.values()):
        table = importlib.import_module(MODULES[name]).measure()
        table.show()
        if out is not None:
            table.save(out)
