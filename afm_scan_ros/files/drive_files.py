"""Files of drives for a lab's own converter, one pair a record, and of learned corrections."""

import json
from collections.abc import Collection, Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np
from attrs import asdict, frozen

from afm_scan_ros.core.correction import Correction
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.drives.excitation import Plan, excitation_block
from afm_scan_ros.core.model import INVERSES, ScannerModel
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.types import AXES, Array
from afm_scan_ros.files.arrays import open_archive, read_member
from afm_scan_ros.files.model_file import model_hash
from afm_scan_ros.files.paths import replacing
from afm_scan_ros.files.records import naming

DRIVE, PERIOD = "drive_v", "sample_period_s"
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


def write_drives(folder: Path, plans: Sequence[Plan], axes: Sequence[str] = AXES) -> Iterator[Path]:
    """Write each drive as ``NAME.csv`` and ``NAME.npz``, and yield the former's path as it is done.

    The text has the columns ``drive_x_v`` and ``drive_y_v`` (V, those of ``axes``) and one row a
    sample; the arrays are ``drive_v`` (n, axes) and ``sample_period_s``.
    """
    for plan in plans:
        target = folder / f"{plan.name}.csv"
        _write(target, plan, axes)
        yield target


def _write(target: Path, plan: Plan, axes: Sequence[str]) -> None:
    blocks: list[Array] = []
    with replacing(target) as beside, beside.open("w", encoding="utf-8") as file:
        file.write(",".join(f"drive_{axis}_v" for axis in axes) + "\n")
        for first in range(0, plan.total_samples, BLOCK):
            block = excitation_block(plan, first, BLOCK)
            blocks.append(np.column_stack([block.axis(axis) for axis in axes]))
            np.savetxt(file, blocks[-1], fmt="%.7g", delimiter=",")
    period = np.array(plan.sample_period)
    with replacing(target.with_suffix(".npz")) as beside:
        np.savez_compressed(beside, drive_v=np.vstack(blocks), sample_period_s=period)


def save_drive(folder: Path, plan: Plan) -> Path:
    """Write the drive of both axes as ``NAME.npz``, as ``write_drives`` does, and return its path.

    It is not compressed: nodes read it at once.
    """
    target = folder / f"{plan.name}.npz"
    block = excitation_block(plan, 0, plan.total_samples)
    drive = np.column_stack([block.x, block.y])
    with replacing(target) as beside:
        np.savez(beside, drive_v=drive, sample_period_s=np.array(plan.sample_period))
    return target


def read_drive(path: Path) -> Plan:
    """Read the drive of both axes from ``NAME.npz``; its name is that of the file.

    Raises InputError naming the file where it holds none.
    """
    try:
        with open_archive(path) as archive:
            drive, period = (read_member(archive, f"{name}.npy") for name in (DRIVE, PERIOD))
    except Exception as error:  # whatever a damaged file makes zipfile and numpy run into
        raise InputError(
            f"{path}: no drive: {error}; give an .npz file with {DRIVE} and {PERIOD}"
        ) from error
    shaped = drive.ndim == 2 and drive.shape[1] == len(AXES) and len(drive) > 1  # noqa: PLR2004
    if not (shaped and np.isfinite(drive).all()):
        raise InputError(
            f"{path}: {DRIVE} of shape {drive.shape}: give finite numbers, x and y in a row"
        )
    if period.size != 1 or not 0.0 < float(period.item()) < np.inf:
        raise InputError(f"{path}: {PERIOD}: give one positive number")
    return Plan(path.stem, float(period.item()), *np.ascontiguousarray(drive.T))


LARGEST = 2**16
"""Bytes of the text on what a correction was made for, a hundred times those that are written."""


@frozen(eq=False)
class StoredCorrection:
    """A correction and the hash of the model whose inverse it was learned with."""

    correction: Correction
    model_hash: str

    def refuse_other(
        self, spec: ScanSpec, model: ScannerModel, inverses: Collection[str] = INVERSES
    ) -> None:
        """Raise InputError where it was learned for another scan, model or inverses."""
        if frozenset(inverses) != frozenset(INVERSES):
            raise InputError(f"was learned with all inverses: give {', '.join(INVERSES)}")
        own = asdict(self.correction.spec)
        for name, value in asdict(spec).items():
            if value != own[name]:
                raise InputError(
                    f"was learned at {name} = {own[name]}, but this scan has {value}: learn this"
                    " scan, or scan as it was learned"
                )
        if model_hash(model) != self.model_hash:
            raise InputError(
                "was learned with another model: learn it with this model, or scan with that one"
            )


def save_learned(path: Path, correction: Correction, model: ScannerModel) -> None:
    """Write a correction that was learned with a model."""
    made_for = {"scan": asdict(correction.spec), "model_hash": model_hash(model)}
    text = np.frombuffer(json.dumps(made_for).encode(), np.uint8)
    with replacing(path) as beside, beside.open("wb") as stream:
        np.savez_compressed(stream, x=correction.x, y=correction.y, made_for=text)


def load_learned(path: Path) -> StoredCorrection:
    """Read a correction; raises InputError where the file is damaged or is none."""
    try:
        with open_archive(path) as archive:
            text = read_member(archive, "made_for.npy", LARGEST)
            x, y = (read_member(archive, f"{name}.npy") for name in AXES)
        made_for = json.loads(text.astype(np.uint8).tobytes())
        spec = ScanSpec(**made_for["scan"])
        digest = str(made_for["model_hash"])
    except FileNotFoundError:
        raise InputError(f"{path}: no such file: give one that 'afm-scan learn' wrote") from None
    except Exception as error:  # zipfile raises whatever a damaged file makes it run into
        raise InputError(
            f"{path}: is damaged, or no file that 'afm-scan learn' wrote: {error}"
        ) from error
    with naming(path):
        return StoredCorrection(
            Correction(spec, np.asarray(x, float), np.asarray(y, float)), digest
        )
