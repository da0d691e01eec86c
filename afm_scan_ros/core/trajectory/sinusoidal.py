"""Sinusoidal raster: x one sine a line, y one smooth step after each trace."""

import numpy as np
from numpy.typing import NDArray

from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.trajectory.raster import line_and_way, stepped_y
from afm_scan_ros.core.types import Array


def sinusoidal(spec: ScanSpec, samples: NDArray[np.int64]) -> tuple[Array, Array]:
    """Displacement in m at sample numbers counted from the first line's start.

    x starts at rest at ``-range_x / 2`` and swings on before the first line and after the last.
    """
    turn = (samples % spec.samples_per_line) / spec.samples_per_line
    y = stepped_y(spec, *line_and_way(spec, samples))
    return -0.5 * spec.range_x * np.cos(2.0 * np.pi * turn), y
