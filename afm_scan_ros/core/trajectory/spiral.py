"""Spiral of Archimedes at constant angular rate, from rest at the centre to a closing circle."""

import numpy as np
from numpy.typing import NDArray

from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.trajectory.shapes import soft_ramp
from afm_scan_ros.core.types import Array


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
