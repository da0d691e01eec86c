"""Lissajous figure: two sines whose periods are as ``lines - 1`` to ``lines``."""

import numpy as np
from numpy.typing import NDArray

from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.types import Array


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
