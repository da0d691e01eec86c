"""Mistakes in the files of a scan: refused by name, or the answer for the file as it then reads."""

import shutil
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from attrs import frozen

from afm_scan_bench.faults.damage import Rng, cut, edited, turned
from afm_scan_bench.faults.faults import Announce
from afm_scan_bench.faults.injection.node_parameters import read_parameters
from afm_scan_bench.faults.injection.outcome import LossError, Tally, damaged
from afm_scan_bench.faults.injection.readings import refuse_other, written, written_model
from afm_scan_ros.core.compensation import Compensation
from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.limits import DriveLimits
from afm_scan_ros.core.model import INVERSES, InverseSettings
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.trajectory import desired, phases
from afm_scan_ros.core.types import AXES, Trace
from afm_scan_ros.files import share_directory
from afm_scan_ros.files.arrays import load_sealed
from afm_scan_ros.files.model_file import load_model, model_hash
from afm_scan_ros.files.plant_file import PARAMETERS, load_plant, load_scan
from afm_scan_ros.files.records import to_mapping
from afm_scan_ros.files.yaml import save
from afm_scan_ros.nodes.parameters import FLOW
from afm_scan_ros.report.table import Row
from afm_scan_ros.simulation.scanner import Piezoscanner

TRIALS = 1200
PERIOD = 5e-5
RAMP = np.linspace(0.0, 1.0, 300)
SPEC = ScanSpec(range_x=1e-6, range_y=1e-6, samples_per_line=1000, line_rate=20.0, approach=0.01)
TURNED = 0.8
"""Share of the damaged arrays in which a byte turns over; the others are cut."""
ANSWERED, BEYOND = "answered as they read", "loaded, then refused as they cannot be scanned"


@frozen
class FileKind:
    """Files of one kind: how they are damaged, and what reads them and judges the reading."""

    files: tuple[str, ...]
    damage: Callable[[bytes, Rng], bytes]
    read: Callable[[Path], str]


def inject(announce: Announce, trials: int = TRIALS) -> Iterator[Row]:
    """Make one mistake a trial in one of the files of ``config/``."""
    rng = np.random.default_rng(1)
    with TemporaryDirectory() as folder:
        for fault, kind in KINDS.items():
            announce(f"mistakes in {fault}")
            tally = Tally()
            for trial in range(trials // len(KINDS)):
                path = _copied(kind.files[trial % len(kind.files)], Path(folder))
                changed = kind.damage(path.read_bytes(), rng)
                with damaged(path, changed), np.errstate(all="ignore"):
                    tally.judge(partial(kind.read, path), path.name)
            yield tally.row(f"a mistake in {fault}")


def read_scan_specification(path: Path) -> str:
    """Read a scan, hold it against the file, and compute some of it."""
    spec, rest = load_scan(path, [parameter.name for parameter in FLOW])
    (section,) = written(path).values()
    refuse_other(section[PARAMETERS], {**to_mapping(spec), **rest})
    where = phases(spec)
    for first in (0, where.approach.start, where.lines.start, where.settle.start, where.total - 9):
        _refuse_not_finite(desired(spec, first, 10))
    return ANSWERED


def read_plant(path: Path) -> str:
    """Read a plant, hold it against the file, and drive it."""
    plant = load_plant(path)
    refuse_other(written(path), to_mapping(plant))
    try:
        for trace in Piezoscanner(plant, PERIOD, 1).advance(Trace(0, PERIOD, RAMP, -RAMP)):
            _refuse_not_finite(trace)
    except ScanError:
        return BEYOND
    return ANSWERED


def read_model(path: Path) -> str:
    """Read a model, hold it against the file, and compensate the beginning of a scan by it."""
    model = load_model(path)
    if model_hash(model) != model_hash(written_model(path)):
        raise LossError("another model than is written")
    settings, limits = InverseSettings(), DriveLimits(5.0, 2e5)
    try:
        chain = Compensation(model, SPEC.sample_period, INVERSES, settings, limits)
        begun, drive = chain.invert(chain.at_rest(), desired(SPEC, 0, 300))
        for trace in (drive, chain.finish(begun)):
            _refuse_not_finite(trace)
    except (ScanError, InputError):
        return BEYOND
    return ANSWERED


def read_arrays(path: Path) -> str:
    """Read the model whose arrays lie in the file; none may be read that is not its own."""
    load_model(path.with_suffix(".yaml"))
    raise LossError("arrays that were damaged are read")


def _refuse_not_finite(trace: Trace) -> None:
    for axis in AXES:
        if not np.isfinite(trace.axis(axis)).all():
            raise LossError(f"{axis} is no finite number")


def _copied(name: str, folder: Path) -> Path:
    """Copy a file, and a model without its digest, which would refuse each mistake unread."""
    config = share_directory() / "config"
    for each in {name, "model.npz"}:
        shutil.copy(config / each, folder)
    save(folder / "model.yaml", load_sealed(config / "model.yaml"), "")
    return folder / name


def _binary(content: bytes, rng: Rng) -> bytes:
    return turned(content, rng) if rng.random() < TURNED else cut(content, rng)


KINDS = {
    "a scan specification": FileKind(("scan.yaml",), edited, read_scan_specification),
    "a plant": FileKind(("plant.yaml",), edited, read_plant),
    "a model": FileKind(("model.yaml",), edited, read_model),
    "a model's arrays": FileKind(("model.npz",), _binary, read_arrays),
    "a node's parameters": FileKind(
        (
            *("scan.yaml", "inversion_compensator.yaml", "piezoscanner_sim.yaml"),
            *("residual_monitor.yaml", "scan_imager.yaml", "scan_recorder.yaml"),
        ),
        edited,
        read_parameters,
    ),
}
