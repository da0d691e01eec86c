"""Drives as files for a lab's own converter: text, and numpy arrays, one pair a record."""

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.drives.excitation import Plan, excitation_block
from afm_scan_ros.core.identification.drives.waypoints import Waveform
from afm_scan_ros.core.types import AXES, Array

BLOCK = 100_000
"""Samples that are held as text at once."""


def make_folder(folder: Path, names: Iterable[str]) -> None:
    """Make a folder for the drives of these names.

    Raises InputError where it cannot be made, or holds one of their files already.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder}: {error.strerror}: give another folder") from None
    files = [f"{name}{suffix}" for name in names for suffix in (".csv", ".npz")]
    for path in (folder / file for file in (*files, "README.md")):
        if path.exists():
            raise InputError(f"{path} exists already: give another folder or remove it")


def write_drives(
    folder: Path, plans: Sequence[Plan[Waveform]], axes: Sequence[str] = AXES
) -> Iterator[Path]:
    """Write each drive as ``NAME.csv`` and ``NAME.npz``, and yield the former's path as it is done.

    The text has the columns ``drive_x_v`` and ``drive_y_v`` (V, those of ``axes``) and one row a
    sample; the arrays are ``drive_v`` (n, axes) and ``sample_period_s``.
    """
    for plan in plans:
        target = folder / f"{plan.name}.csv"
        _write(target, plan, axes)
        yield target


def _write(target: Path, plan: Plan[Waveform], axes: Sequence[str]) -> None:
    blocks: list[Array] = []
    with target.open("w", encoding="utf-8") as file:
        file.write(",".join(f"drive_{axis}_v" for axis in axes) + "\n")
        for first in range(0, plan.total_samples, BLOCK):
            block = excitation_block(plan, first, BLOCK)
            blocks.append(np.column_stack([block.axis(axis) for axis in axes]))
            np.savetxt(file, blocks[-1], fmt="%.7g", delimiter=",")
    np.savez_compressed(
        target.with_suffix(".npz"),
        drive_v=np.vstack(blocks),
        sample_period_s=np.array(plan.sample_period),
    )
