"""The model file of a scanner whose axes are coupled: YAML, with its matrices in an .npz beside it.

It has the key ``coupled`` where that of another scanner has ``x`` and ``y``.
"""

from pathlib import Path

import numpy as np
from attrs import asdict, field, frozen
from attrs.validators import gt, matches_re

from afm_scan_ros.core.coupled_scanner import CoupledScanner, FeedbackEffect, LevelError
from afm_scan_ros.core.effects.feedback import Actuators
from afm_scan_ros.core.effects.registry import feedback_form
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.state_space.model import StateSpaceModel
from afm_scan_ros.files import yaml
from afm_scan_ros.files.added_effects import AddedEffect, mapping_of, values_of
from afm_scan_ros.files.arrays import Archive
from afm_scan_ros.files.records import from_mapping, to_mapping

MATRICES = ("a", "b", "c", "d")


@frozen
class _LevelError:
    drive_rms: float = field(metadata={"suffix": "_v"}, validator=gt(0.0))
    error_rms: float = field(metadata={"suffix": "_nm", "scale": 1e-9}, validator=gt(0.0))
    displacement_rms: float = field(metadata={"suffix": "_nm", "scale": 1e-9}, validator=gt(0.0))


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
class _File:
    coupled: _Coupled
    arrays: str = field(validator=matches_re(r"[^/\\]+\.npz"))
    arrays_sha256: str


def save_coupled(path: Path, scanner: CoupledScanner, heading: str) -> None:
    """Write the model and, beside it, its matrices in ``path`` with the ending ``.npz``."""
    linear, actuators = scanner.model.linear, scanner.actuators
    matrices = {name: getattr(linear, name) for name in MATRICES}
    matrices["drive_scale"] = actuators.drive_scale[np.newaxis]
    matrices["elongation"] = actuators.elongation
    beside = path.with_suffix(".npz")
    np.savez(beside, **matrices)
    content = _Coupled(
        scanner.axes,
        scanner.sample_period,
        scanner.model.band,
        scanner.reach,
        actuators.decay_time,
        tuple(_LevelError(**asdict(error)) for error in scanner.errors),
        tuple(_added_to(effect) for effect in scanner.effects),
    )
    file = _File(content, beside.name, Archive(beside).sha256())
    yaml.save(path, to_mapping(file), heading)


def load_coupled(path: Path) -> CoupledScanner:
    """Model of a file; raises InputError naming the file, the key and the fix."""
    content = from_mapping(_File, yaml.load(path), str(path))
    given, archive = content.coupled, Archive(path.parent / content.arrays)
    if content.arrays_sha256 != archive.sha256():
        raise InputError(
            f"{path}: arrays_sha256 is not that of {content.arrays}, so these arrays are of another"
            " model: restore its own arrays"
        )
    a, b, c, d = (archive.matrix(name) for name in MATRICES)
    scale, elongation = archive.matrix("drive_scale"), archive.matrix("elongation")
    actuators = Actuators(scale[0], elongation, given.decay_time, given.sample_period)
    where = f"{path}: coupled: added"
    effects = tuple(_added_from(item, f"{where}[{i}]") for i, item in enumerate(given.added))
    try:
        linear = StateSpaceModel(a, b, c, d, given.sample_period)
        return CoupledScanner(
            given.axes,
            linear,
            given.band,
            effects,
            actuators,
            given.reach,
            tuple(LevelError(**asdict(error)) for error in given.errors),
        )
    except InputError as error:
        raise InputError(f"{path}: {error}") from error


def _added_to(effect: FeedbackEffect) -> AddedEffect:
    parameters = feedback_form(effect.name).parameters
    return AddedEffect(effect.name, "", mapping_of(effect.values, parameters))


def _added_from(item: AddedEffect, where: str) -> FeedbackEffect:
    try:
        parameters = feedback_form(item.name).parameters
    except InputError as error:
        raise InputError(f"{where}: {error}") from error
    return FeedbackEffect(item.name, values_of(item, parameters, where))
