"""The paths of the patterns: raster, sinusoidal, spiral and Lissajous."""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.trajectory.shapes import smooth_step, soft_ramp
from afm_scan_ros.core.types import Array

KEPT = 2
"""Scans of which a line is kept: it may have ten million samples."""


def raster(spec: ScanSpec, samples: NDArray[np.int64]) -> tuple[Array, Array]:
    """Displacement in m at sample numbers counted from the first line's start.

    x starts in the middle of a turn-around, at rest at ``-range_x / 2``; before the first line
    and after the last one it rests there.
    """
    number, way = line_and_way(spec, samples)
    return _line_x(spec)[way], stepped_y(spec, number, way)


def line_and_way(
    spec: ScanSpec, samples: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return each sample's line and its number on that; the scan's ends where it is outside."""
    inside = samples.clip(0, spec.lines * spec.samples_per_line)
    number = inside // spec.samples_per_line
    return number, inside - number * spec.samples_per_line


def stepped_y(spec: ScanSpec, number: NDArray[np.int64], way: NDArray[np.int64]) -> Array:
    """Displacement in y, m: ``lines`` levels from ``-range_y / 2`` to ``range_y / 2``."""
    level = (number + _line_rise(spec)[way]).clip(0.0, spec.lines - 1.0)
    return spec.range_y * (level / (spec.lines - 1) - 0.5)


def step_age(spec: ScanSpec, way: NDArray[np.int64]) -> Array:
    """Return how many samples ago y began to step, before ``way`` samples of a line.

    A step begins where the trace's constant-speed part ends, and may last into the next line.
    """
    period = float(spec.samples_per_line)
    age: Array = np.mod(way - 0.5 * period * (1.0 - 0.5 * spec.turnaround), period)
    return age


@lru_cache(KEPT)
def _line_x(spec: ScanSpec) -> Array:
    """x, m, on a line."""
    way = np.arange(spec.samples_per_line)
    s = np.minimum(way, spec.samples_per_line - way) / (spec.samples_per_line // 2)
    return spec.range_x * (soft_ramp(s, spec.turnaround) - 0.5)


@lru_cache(KEPT)
def _line_rise(spec: ScanSpec) -> Array:
    """Steps of y on a line, less the line's number: below zero until its own begins."""
    way = np.arange(spec.samples_per_line)
    age = step_age(spec, way)
    return smooth_step(age * (spec.sample_period / spec.y_step)) - (age > way)


def sinusoidal(spec: ScanSpec, samples: NDArray[np.int64]) -> tuple[Array, Array]:
    """Displacement in m at sample numbers counted from the first line's start.

    x starts at rest at ``-range_x / 2`` and swings on before the first line and after the last.
    """
    turn = (samples % spec.samples_per_line) / spec.samples_per_line
    y = stepped_y(spec, *line_and_way(spec, samples))
    return -0.5 * spec.range_x * np.cos(2.0 * np.pi * turn), y


def spiral(spec: ScanSpec, samples: NDArray[np.int64]) -> tuple[Array, Array]:
    """Displacement in m at sample numbers counted from the first turn's start.

    The radius grows over all turns but the last, evenly except in the first and the last of
    them, where it starts and ends softly. The last turn is the whole outer ellipse, which gives
    the scan its ranges; after it the scanner stays on that ellipse, before the first turn it
    rests at the centre.
    """
    growing = spec.lines - 1
    turn = (samples % spec.samples_per_line) / spec.samples_per_line
    turns = samples / spec.samples_per_line
    radius = 0.5 * soft_ramp(turns / growing, min(1.0, 2.0 / growing))
    angle = 2.0 * np.pi * turn
    return spec.range_x * radius * np.cos(angle), spec.range_y * radius * np.sin(angle)


def lissajous(spec: ScanSpec, samples: NDArray[np.int64]) -> tuple[Array, Array]:
    """Displacement in m at sample numbers counted from the start, at the centre.

    x has one period a line, y ``lines - 1`` periods in ``lines`` lines, after which the figure
    closes. It goes on before the first line and after the last.
    """
    return (
        0.5 * spec.range_x * _sine(spec, samples, spec.lines),
        0.5 * spec.range_y * _sine(spec, samples, spec.lines - 1),
    )


def _sine(spec: ScanSpec, samples: NDArray[np.int64], periods: int) -> Array:
    whole = spec.lines * spec.samples_per_line
    turn = (samples * periods % whole) / whole
    result: Array = np.sin(2.0 * np.pi * turn)
    return result
