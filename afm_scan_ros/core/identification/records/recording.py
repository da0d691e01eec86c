"""What a calibration record holds, checked before anything is fitted to it.

Each check may take for granted that those before it found nothing.
"""

from collections.abc import Iterator, Sequence

import numpy as np
from attrs import evolve, frozen

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.records.motion import (
    motion_problems,
    offset_at_rest,
    saturation_problems,
)
from afm_scan_ros.core.identification.records.samples import course_problems, sensor_problems
from afm_scan_ros.core.record import Record
from afm_scan_ros.core.types import AXES, Array

FARTHEST = 1e-2
"""m: piezo ceramics strain by 0.1 %, so that even amplified tenfold they would be a metre long. A
displacement that is farther is in another unit."""
FEWEST = 100
"""Samples, fewer than which no record has."""
HIGHEST = 1e3
"""V: the stacks of the thickest layers, half a millimetre at 2 V/µm, take as much."""


def problems(record: Record) -> Iterator[str]:
    """Yield what keeps a record from being fitted, worst first.

    Axes that rest are not looked at.
    """
    traces = record.traces()
    if len(record.drive) < FEWEST:
        yield (
            f"it holds {len(record.drive)} samples, too few of any record; {FEWEST} are the least"
        )
    yield from _at_rest(record)
    moving = driven(record)
    yield from _units(record, moving)
    for axis in moving:
        yield from sensor_problems(axis, *record.signals(axis))
    yield from motion_problems(*traces, moving)
    for axis in moving:
        yield from saturation_problems(axis, *record.signals(axis))
        yield from course_problems(axis, *record.signals(axis))


def driven(record: Record) -> tuple[str, ...]:
    """Name the axes whose drive changes: a record identifies nothing of the others."""
    return tuple(axis for axis in record.axes if np.ptp(record.signals(axis)[0]))


def _at_rest(record: Record) -> Iterator[str]:
    moving = driven(record)
    if not moving:
        yield f"drive {record.axes[0]} never changes: nothing to fit; record it again"
    for axis in moving:
        if not np.ptp(record.signals(axis)[1]):
            yield f"displacement {axis} never changes: nothing to fit; record it again"


def _units(record: Record, axes: Sequence[str]) -> Iterator[str]:
    for axis in axes:
        drive, displacement = record.signals(axis)
        farthest = float(np.abs(displacement).max())
        if farthest > FARTHEST:
            yield (
                f"displacement {axis} reaches {farthest:.3g} m, and no piezo moves by more than"
                f" {FARTHEST:g} m: is it in µm or in the sensor's V? record it in m, or say its"
                " unit in --columns"
            )
        highest = float(np.abs(drive).max())
        if highest > HIGHEST:
            yield (
                f"drive {axis} reaches {highest:.3g} V, above {HIGHEST:g} V: is it in mV?"
                " record it in V, or say its unit in --columns"
            )


def kind_of(record: str, axes: Sequence[str]) -> str:
    """Name a record of these axes: ``creep``, or ``creep_x_only`` where it holds one of two."""
    return record if len(axes) == len(AXES) else f"{record}_{'_'.join(axes)}_only"


def kind_and_axes(name: str) -> tuple[str, tuple[str, ...]]:
    """Return what a record named by ``kind_of`` is, and the axes that it holds."""
    for axis in AXES:
        if name.endswith(only := kind_of("", (axis,))):
            return name.removesuffix(only), (axis,)
    return name, AXES


def checked(record: Record) -> Record:
    """Return a record as it is fitted: of the axes that are driven, and counted from rest.

    A sensor's zero is arbitrary, so the displacement is counted from where it rests until the drive
    first changes. Raises InputError, which names the record, where it is no good one of its axes.
    """
    for problem in problems(record):
        raise InputError(f"record {record.name}: {problem}")
    axes = tuple(axis for axis in AXES if axis in driven(record))
    signals = [record.signals(axis) for axis in axes]
    drive = np.stack([drive for drive, _ in signals]).T
    moved = np.stack([moved - offset_at_rest(drive, moved) for drive, moved in signals]).T
    return evolve(record, drive=drive, displacement=moved, axes=axes)


@frozen
class Misfit:
    """How far a prediction lies from what was measured (Eqs. 2, 3, 18, 19), in its unit."""

    sigma: float
    maximum: float
    samples: int


def misfit(error: Array) -> Misfit:
    """Standard deviation about zero with N - 1 (Eqs. 2, 18) and maximum (Eqs. 3, 19)."""
    sigma = np.sqrt(np.sum(error**2) / (len(error) - 1))
    return Misfit(float(sigma), float(np.abs(error).max()), len(error))
