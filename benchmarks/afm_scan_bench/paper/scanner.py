"""The scan of the paper's images: it begins at rest, at zero displacement, in a corner.

The paper publishes no sensor sensitivity. At the 8 µm/V that this package assumes, a scan of 40 µm
that begins at zero displacement would leave the ±4 V over which hysteresis is identified. The same
scanner, alike in volts, is therefore read at 16 µm/V here: plant, noise and model are scaled alike.
"""

from collections.abc import Iterable

import numpy as np
from attrs import evolve, frozen

from afm_scan_bench.scans import SEED, default_model, default_plant
from afm_scan_ros.core.model import AxisModel, InverseSettings, VibrationModel
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.scanner import chain_of
from afm_scan_ros.core.trajectory import raster
from afm_scan_ros.core.types import AXES, Array, Trace
from afm_scan_ros.simulation.scanner import Piezoscanner, PlantSpec

SCALE = 2.0
"""Of the default sensor sensitivity."""

RANGE = 40e-6
REST = 0.05
"""Seconds at rest before and after the lines: more than the preview."""

SAMPLES = {1.0: 4000, 5.0: 4000, 30.0: 1000, 100.0: 500, 250.0: 400}
"""Samples in a line, by the line rates (Hz) of the paper's figures."""


@frozen(eq=False)
class PaperScan:
    """The lines of one scan: displacements in m, without the rest before and after."""

    spec: ScanSpec
    desired: Trace
    measured: Trace
    true: Trace


def paper_spec(line_rate: float, lines: int) -> ScanSpec:
    """Return a scan along sharp triangles, as the paper's."""
    return ScanSpec(
        range_x=RANGE,
        range_y=RANGE,
        line_rate=line_rate,
        lines=lines,
        samples_per_line=SAMPLES[line_rate],
        turnaround=0.0,
        y_step=min(2e-3, 0.4 / line_rate),
        preparation="none",
    )


def scan_as_paper(spec: ScanSpec, inverses: Iterable[str]) -> PaperScan:
    """Scan from zero displacement, the scanner depolarised, with some of the inverses.

    Without the inverse hysteresis the drive takes H for 1, as a model of the response to small
    inputs does.
    """
    chosen, period = tuple(inverses), spec.sample_period
    rest = round(REST / period)
    target = paper_path(spec, rest)
    drives = Trace(0, period, *(_drive(axis, target, chosen) for axis in AXES))
    measured, true = Piezoscanner(scaled_plant(), period, SEED).advance(drives)
    return PaperScan(spec, *(_lines(trace, rest, spec) for trace in (target, measured, true)))


def paper_path(spec: ScanSpec, rest: int) -> Trace:
    """Desired displacement, m: the raster moved to begin at zero, with rests of some samples."""
    samples = np.arange(-rest, spec.lines * spec.samples_per_line + rest, dtype=np.int64)
    x, y = raster(spec, samples)
    return Trace(0, spec.sample_period, x + 0.5 * spec.range_x, y + 0.5 * spec.range_y)


def scaled_plant() -> PlantSpec:
    """Return the default plant, read with the larger sensor sensitivity."""
    plant = default_plant()
    sensor = plant.sensor
    return evolve(
        plant,
        sensor_sensitivity=SCALE * plant.sensor_sensitivity,
        sensor=evolve(sensor, noise_rms=SCALE * sensor.noise_rms, span=SCALE * sensor.span),
    )


def scaled_model(axis: str) -> AxisModel:
    """Return the default model of one axis, of displacements read with that sensitivity."""
    model = default_model().axis(axis)
    numerator = tuple(SCALE * c for c in model.vibration.numerator)
    return evolve(model, vibration=VibrationModel(numerator, model.vibration.denominator))


def _drive(axis: str, target: Trace, inverses: tuple[str, ...]) -> Array:
    model = scaled_model(axis)
    inverse = chain_of(model).compensator(target.sample_period, inverses, InverseSettings())
    state, begun = inverse.invert(inverse.inverse_at_rest(), target.axis(axis))
    drive = np.concatenate((begun, inverse.finish(state)))
    return drive if "hysteresis" in inverses else drive * model.hysteresis.forward.chord


def _lines(trace: Trace, rest: int, spec: ScanSpec) -> Trace:
    lines = slice(rest, rest + spec.lines * spec.samples_per_line)
    return Trace(0, trace.sample_period, trace.x[lines], trace.y[lines])
