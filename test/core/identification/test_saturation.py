"""A drive's end where little moves: hum that hides it, or a limit."""

from collections.abc import Iterator

import numpy as np

from afm_scan_ros.core.identification.records.motion import saturation_problems
from afm_scan_ros.core.types import Array

SAMPLES = 4000
DRIVE = np.concatenate([np.linspace(0.0, 10.0, SAMPLES), np.linspace(10.0, 0.0, SAMPLES)])
"""V, once there and back, so that one branch each comes to the bottom and goes from it."""


def hums() -> Iterator[Array]:
    """Cycles of hum of 4 % of the range, from any phase."""
    cycles = np.linspace(0.0, 50.5, len(DRIVE))
    for phase in np.linspace(0.0, 1.0, 12, endpoint=False):
        yield 0.4 * np.sin(2.0 * np.pi * (cycles + phase))


def test_hum_is_no_limit() -> None:
    assert not [each for hum in hums() for each in saturation_problems("x", DRIVE, DRIVE + hum)]


def test_a_limit_is_found_under_a_little_hum() -> None:
    for hum in hums():
        moved = np.maximum(DRIVE, 2.0) + 0.03 * hum
        (message,) = saturation_problems("x", DRIVE, moved)
        assert "saturates: at the bottom" in message
