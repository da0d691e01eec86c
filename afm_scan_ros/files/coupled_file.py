"""The model file of a scanner whose axes are coupled: YAML, with its matrices in an .npz beside it.

It has the key ``coupled`` where that of another scanner has ``x`` and ``y``.
"""

from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np
from attrs import field, frozen
from attrs.validators import deep_iterable, gt, matches_re, min_len

from afm_scan_ros.core.coupled_scanner import CoupledScanner, FeedbackEffect, LevelError
from afm_scan_ros.core.effects.effect_type import Actuators
from afm_scan_ros.core.effects.registry import feedback_form
from afm_scan_ros.core.identification.state_space.model import StateSpaceModel
from afm_scan_ros.files import yaml
from afm_scan_ros.files.arrays import arrays_beside, load_sealed, saved_arrays, sealed
from afm_scan_ros.files.model_file import AddedEffect, listed, values_of
from afm_scan_ros.files.records import from_mapping, naming, recast, to_mapping

MATRICES = ("a", "b", "c", "d")


@frozen
class _LevelError:
    drive_rms: float = field(metadata={"suffix": "_v"}, validator=gt(0.0))
    error_rms: float = field(metadata={"suffix": "_nm", "scale": 1e-9}, validator=gt(0.0))
    displacement_rms: float = field(metadata={"suffix": "_nm", "scale": 1e-9}, validator=gt(0.0))
    by_band: tuple[float, ...] = field(validator=[min_len(1), deep_iterable(gt(0.0))])


@frozen
class _Coupled:
    axes: tuple[str, ...]
    sample_period: float = field(metadata={"suffix": "_s"}, validator=gt(0.0))
    band: tuple[float, float] = field(metadata={"suffix": "_hz"})
    reach: float = field(metadata={"suffix": "_v"}, validator=gt(0.0))
    decay_time: float = field(metadata={"suffix": "_s"}, validator=gt(0.0))
    errors: tuple[_LevelError, ...]
    added: tuple[AddedEffect, ...] = ()


@frozen
class _CoupledFile:
    coupled: _Coupled
    arrays: str = field(validator=matches_re(r"[^/\\]+\.npz"))
    arrays_sha256: str


def save_coupled(path: Path, scanner: CoupledScanner, heading: str) -> None:
    """Write the model and, beside it, its matrices in ``path`` with the ending ``.npz``."""
    linear, actuators = scanner.model.linear, scanner.actuators
    matrices = {name: getattr(linear, name) for name in MATRICES}
    matrices["drive_scale"] = actuators.drive_scale[np.newaxis]
    matrices["elongation"] = actuators.elongation
    content = _Coupled(
        scanner.axes,
        scanner.sample_period,
        scanner.model.band,
        scanner.reach,
        actuators.decay_time,
        tuple(recast(_LevelError, error) for error in scanner.errors),
        tuple(
            listed(effect.name, "", effect.values, feedback_form(effect.name).parameters)
            for effect in scanner.effects
        ),
    )
    with saved_arrays(path, matrices) as (beside, digest):
        file = _CoupledFile(content, beside, digest)
        yaml.save(path, sealed(to_mapping(file)), heading)


def load_coupled(path: Path) -> CoupledScanner:
    """Model of a file; raises InputError naming the file, the key and the fix."""
    content = from_mapping(_CoupledFile, load_sealed(path), str(path))
    given = content.coupled
    archive = arrays_beside(path, content.arrays, content.arrays_sha256)
    a, b, c, d = (archive.matrix(name) for name in MATRICES)
    scale, elongation = archive.matrix("drive_scale"), archive.matrix("elongation")
    with naming(path):
        archive.refuse_others(content.arrays_sha256)
        return CoupledScanner(
            given.axes,
            StateSpaceModel(a, b, c, d, given.sample_period),
            given.band,
            tuple(_effects(given.added)),
            Actuators(scale[0], elongation, given.decay_time, given.sample_period),
            given.reach,
            tuple(recast(LevelError, error) for error in given.errors),
        )


def _effects(items: Iterable[AddedEffect]) -> Iterator[FeedbackEffect]:
    for number, item in enumerate(items):
        with naming(f"coupled: added[{number}]"):
            parameters = feedback_form(item.name).parameters
            yield FeedbackEffect(item.name, values_of(item, parameters))
