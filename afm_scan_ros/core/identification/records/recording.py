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
from afm_scan_ros.core.types import AXES, Array, Trace

FARTHEST = 1e-2
"""m: piezo ceramics strain by 0.1 %, so that even amplified tenfold they would be a metre long. A
displacement that is farther is in another unit."""
FEWEST = 100
"""Samples, fewer than which no record has."""
HIGHEST = 1e3
"""V: the stacks of the thickest layers, half a millimetre at 2 V/µm, take as much."""


def problems(drive: Trace, displacement: Trace, axes: Sequence[str] = AXES) -> Iterator[str]:
    """Yield what keeps a drive (V) and a displacement (m) from being one record, worst first.

    ``axes`` are those that it is a record of; those of them that rest are not looked at.
    """
    yield from _pairing(drive, displacement)
    for quantity, trace in (("drive", drive), ("displacement", displacement)):
        for axis in axes:
            yield from _bad_numbers(f"{quantity} {axis}", trace.axis(axis))
    yield from _at_rest(drive, displacement, axes)
    moving = driven(drive, axes)
    yield from _units(drive, displacement, moving)
    for axis in moving:
        yield from sensor_problems(axis, drive.axis(axis), displacement.axis(axis))
    yield from motion_problems(drive, displacement, moving)
    for axis in moving:
        given, moved = drive.axis(axis), displacement.axis(axis)
        yield from saturation_problems(axis, given, moved)
        yield from course_problems(axis, given, moved)


def _pairing(drive: Trace, displacement: Trace) -> Iterator[str]:
    if drive.sample_period != displacement.sample_period:
        yield (
            f"drive every {drive.sample_period:g} s, displacement every"
            f" {displacement.sample_period:g} s; record both at one sample period"
        )
    if len(drive.x) != len(displacement.x):
        yield (
            f"{len(drive.x)} drive samples, {len(displacement.x)} displacement samples;"
            " record the scan to its end"
        )
    if 0 < len(drive.x) < FEWEST:
        yield f"it holds {len(drive.x)} samples, too few of any record; {FEWEST} are the least"
    if drive.first_sample or displacement.first_sample:
        yield "it begins in the middle of a scan; record it from its first sample"


def _bad_numbers(quantity: str, values: Array) -> Iterator[str]:
    wrong = np.flatnonzero(~np.isfinite(values))
    if wrong.size:
        yield f"{quantity} is {values[wrong[0]]} at sample {wrong[0]}; record it again"


def driven(drive: Trace, axes: Sequence[str]) -> tuple[str, ...]:
    """Name those axes whose drive changes: a record identifies nothing of the others."""
    return tuple(axis for axis in axes if not _rests(drive.axis(axis)))


def _at_rest(drive: Trace, displacement: Trace, axes: Sequence[str]) -> Iterator[str]:
    moving = driven(drive, axes)
    if not moving:
        yield f"drive {axes[0]} never changes: nothing to fit; record it again"
    for axis in moving:
        if _rests(displacement.axis(axis)):
            yield f"displacement {axis} never changes: nothing to fit; record it again"


def _rests(values: Array) -> bool:
    return values.size == 0 or float(np.ptp(values)) == 0.0


def _units(drive: Trace, displacement: Trace, axes: Sequence[str]) -> Iterator[str]:
    for axis in axes:
        farthest = float(np.abs(displacement.axis(axis)).max())
        if farthest > FARTHEST:
            yield (
                f"displacement {axis} reaches {farthest:.3g} m, and no piezo moves by more than"
                f" {FARTHEST:g} m: is it in µm or in the sensor's V? record it in m, or say its"
                " unit in --columns"
            )
        highest = float(np.abs(drive.axis(axis)).max())
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


@frozen(eq=False)
class CalibrationRecord:
    """Drive (V) and measured displacement (m) of one record, sample by sample, from rest.

    ``axes`` are those that it holds and that are driven. The displacement is counted from where it
    rests until the drive first changes, since a sensor's zero is arbitrary.
    Raises InputError, which names the record, where the two are not one good record of the axes.
    """

    name: str
    drive: Trace
    displacement: Trace
    axes: tuple[str, ...] = AXES

    def __attrs_post_init__(self) -> None:
        for problem in problems(self.drive, self.displacement, self.axes):
            raise InputError(f"record {self.name}: {problem}")
        x, y = (self._from_rest(axis) for axis in AXES)
        object.__setattr__(self, "displacement", evolve(self.displacement, x=x, y=y))
        object.__setattr__(self, "axes", driven(self.drive, self.axes))

    def _from_rest(self, axis: str) -> Array:
        displacement = self.displacement.axis(axis)
        return displacement - offset_at_rest(self.drive.axis(axis), displacement)

    @property
    def sample_period(self) -> float:
        """Seconds between samples."""
        return self.drive.sample_period


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
