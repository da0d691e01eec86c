"""What a sensor or a converter at fault leaves in a displacement."""

from collections.abc import Iterator

import numpy as np

from afm_scan_ros.core.types import Array

RAIL = 16
"""Samples in succession at the very same extreme that noise does not leave to chance."""


def sensor_problems(axis: str, drive: Array, displacement: Array) -> Iterator[str]:
    """Yield what is wrong with a displacement (m) under a drive (V), both (n,), of an axis."""
    yield from _clipped(axis, drive, displacement)


def _clipped(axis: str, drive: Array, displacement: Array) -> Iterator[str]:
    """Find the sensor at its rail: noise does not give the same extreme many times in a row."""
    if np.mean(np.diff(displacement) == 0.0) > 0.5:  # noqa: PLR2004 - too coarse to tell
        return
    driven = drive != drive[0]
    for end, rail in (("lower", displacement.min()), ("upper", displacement.max())):
        free = np.flatnonzero((displacement != rail) | ~driven)
        runs = np.diff(free, prepend=-1, append=len(displacement)) - 1
        if runs.max() >= RAIL:
            first = int(np.append(-1, free)[runs.argmax()]) + 1
            yield (
                f"displacement {axis} is clipped at its {end} end, {rail:.4g} m, for {runs.max()}"
                f" samples from sample {first}; record it with less drive or a wider sensor range"
            )
