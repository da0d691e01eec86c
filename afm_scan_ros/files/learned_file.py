"""The file of a learned correction: an .npz that states its scan and its model."""

import json
from collections.abc import Collection
from pathlib import Path

import numpy as np
from attrs import asdict, frozen

from afm_scan_ros.core.correction import Correction
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.model import INVERSES, ScannerModel
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.types import AXES
from afm_scan_ros.files.arrays import open_archive, read_member
from afm_scan_ros.files.model_file import model_hash
from afm_scan_ros.files.paths import replacing
from afm_scan_ros.files.records import naming

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
