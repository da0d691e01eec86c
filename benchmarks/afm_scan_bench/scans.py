"""Scans run within one process: the nodes' own core and simulated scanner, without the wires."""

import math
from collections.abc import Iterable
from functools import cache

import numpy as np
from attrs import evolve

from afm_scan_ros.core.compensation import Compensation
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.metrics import AxisError, ErrorSplit, Figure, Scan, Tracking
from afm_scan_ros.core.model import InverseSettings, ScannerModel
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.trajectory import desired, phases, sample_kinds, total_samples
from afm_scan_ros.core.types import Array
from afm_scan_ros.files import share_directory
from afm_scan_ros.files.model_file import load_model
from afm_scan_ros.files.plant_file import load_plant
from afm_scan_ros.simulation.scanner import Piezoscanner, PlantSpec

SEED = 1
ALL = ("creep", "hysteresis", "vibration")
BENCH_SPEC = ScanSpec(lines=6, preparation_lower=-28e-6, preparation_upper=25e-6)
SAMPLES_AND_TURNAROUND = {
    1.0: (20_000, 0.1),
    5.0: (4_000, 0.1),
    30.0: (1_000, 0.1),
    100.0: (500, 0.2),
    250.0: (200, 0.3),
}


@cache
def default_model() -> ScannerModel:
    """Return the model in ``config/model.yaml``."""
    return load_model(share_directory() / "config/model.yaml")


@cache
def default_plant() -> PlantSpec:
    """Return the plant in ``config/plant.yaml``."""
    return load_plant(share_directory() / "config/plant.yaml")


def spec_at(line_rate: float) -> ScanSpec:
    """Scan of 40 µm peak to peak at one of the line rates that the figures are stated for."""
    if line_rate not in SAMPLES_AND_TURNAROUND:
        raise InputError(f"no figures are stated at {line_rate:g} Hz: choose another line rate")
    samples, turnaround = SAMPLES_AND_TURNAROUND[line_rate]
    return evolve(BENCH_SPEC, line_rate=line_rate, samples_per_line=samples, turnaround=turnaround)


def scan(
    spec: ScanSpec,
    inverses: Iterable[str],
    settings: InverseSettings | None = None,
    plant: PlantSpec | None = None,
    model: ScannerModel | None = None,
    seed: int = SEED,
) -> Scan:
    """Scan the plant with the model's inverses; each is the default one where none is given."""
    scanned = plant or default_plant()
    compensation = Compensation(
        model or default_model(),
        spec.sample_period,
        inverses,
        settings or InverseSettings(),
        scanned.amplifier.limits,
    )
    target = desired(spec, 0, total_samples(spec))
    commanded = compensation.whole(target)
    measured, true = Piezoscanner(scanned, spec.sample_period, seed).advance(commanded)
    return Scan(spec, target, commanded, measured, true)


def tracking(done: Scan) -> Tracking:
    """Figures of the true, noise-free displacement of a scan."""
    return done.tracking("true")


def split_of(error: AxisError) -> ErrorSplit:
    """Offset, gain and shape of an error; ValueError where its samples hold one position."""
    if error.split is None:
        raise ValueError("the samples hold one position")
    return error.split


def rms_percent(figure: Figure | None) -> float:
    """Rms error in % of the range; NaN where no sample is of that kind."""
    return 100.0 * figure.rms_share if figure else math.nan


def largest_percent(figure: Figure | None) -> float:
    """Largest error in % of the range; NaN where no sample is of that kind."""
    return 100.0 * figure.largest_share if figure else math.nan


def lines_of(spec: ScanSpec, signal: Array) -> Array:
    """Return the part of a whole scan's signal that lies on its lines."""
    where = phases(spec).lines
    return signal[where.start : where.stop]


def relative_error(spec: ScanSpec, target: Array, achieved: Array) -> float:
    """Rms error of x at constant speed over the range, first to-and-fro left out."""
    where = phases(spec).lines
    second = where.start + spec.samples_per_line
    kinds = sample_kinds(spec, second, where.stop - second)
    error = (achieved - target)[second : where.stop][kinds.trace | kinds.retrace]
    return float(np.sqrt(np.mean(error**2)) / spec.range_x)
