"""A drive's end where little moves: hum that hides it, or a limit."""

from collections.abc import Iterator

import numpy as np

from afm_scan_ros.core.identification.records.motion import saturation_problems, turning_points
from afm_scan_ros.core.types import Array
from helpers.fit_cases import OPERATORS, levels, record

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


def test_a_drive_turns_where_it_pauses_first() -> None:
    drive = np.array([0.0, 1.0, 2.0, 2.0, 2.0, 1.0, 0.0, 0.5, 0.5, 1.0])
    assert turning_points(drive).tolist() == [2, 6]


def test_a_stage_that_rings_is_at_no_limit() -> None:
    """A fast move turns at its end while the stage swings back."""
    slipping = record(OPERATORS["plays"], levels(2, 8, 500))
    assert not list(saturation_problems("x", *slipping.signals("x")))


def test_a_branch_that_only_goes_back_from_an_end_says_nothing_of_it() -> None:
    """The first loop comes from the middle; a play stands still behind its turn at the top."""
    corners = np.array([0.4, 1.0, -1.0, 0.6, -0.6, 0.6])
    drive = np.interp(np.linspace(0.0, 5.0, 2000), np.arange(6), corners)
    held, moved = 0.0, np.empty(len(drive))
    for k, volts in enumerate(drive):
        held = min(max(held, volts - 0.2), volts + 0.2)
        moved[k] = 1e-6 * held
    assert not list(saturation_problems("x", drive, moved))


def test_a_limit_is_found_where_a_long_branch_only_goes_back_from_it() -> None:
    """The top is reached by a short branch; what goes back from it stands still as no other."""
    drive = np.interp(np.linspace(0.0, 5.0, 2000), np.arange(6), [0.7, 1.0, -1.0, 0.6, -0.6, 0.6])
    (message,) = saturation_problems("x", drive, np.minimum(drive, 0.9))
    assert "saturates: at the top" in message
