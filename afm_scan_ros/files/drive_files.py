"""Drives as files for a lab's own converter: text, and numpy arrays, one pair a record."""

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.drives.excitation import Plan, excitation_block
from afm_scan_ros.core.identification.drives.waypoints import Waveform
from afm_scan_ros.core.types import AXES, Array

BLOCK = 100_000
"""Samples that are held as text at once."""


def write_drives(
    folder: Path, plans: Sequence[Plan[Waveform]], axes: Sequence[str] = AXES
) -> Iterator[Path]:
    """Write each drive as ``NAME.csv`` and ``NAME.npz``, and yield the former's path as it is done.

    The text has the columns ``drive_x_v`` and ``drive_y_v`` (V, those of ``axes``) and one row a
    sample; the arrays are ``drive_v`` (n, axes) and ``sample_period_s``. Raises InputError where
    the folder has one of the files already.
    """
    folder.mkdir(parents=True, exist_ok=True)
    targets = [folder / f"{plan.name}.csv" for plan in plans]
    for target in targets:
        for path in (target, target.with_suffix(".npz")):
            if path.exists():
                raise InputError(f"{path} exists already: give another folder or remove it")
    for target, plan in zip(targets, plans, strict=True):
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
