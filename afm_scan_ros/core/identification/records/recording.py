"""What a calibration record holds, checked before anything is fitted to it."""

from collections.abc import Sequence

import numpy as np
from attrs import evolve, frozen

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.records.checks import driven, problems
from afm_scan_ros.core.identification.records.motion import offset_at_rest
from afm_scan_ros.core.types import AXES, Array, Trace


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
