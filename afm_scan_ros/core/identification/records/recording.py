"""What a calibration record holds, checked before anything is fitted to it."""

from collections.abc import Sequence

import numpy as np
from attrs import frozen

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.records.checks import problems
from afm_scan_ros.core.types import AXES, Array, Trace


def kind_of(record: str, axes: Sequence[str]) -> str:
    """Name a record of these axes: ``creep``, or ``creep_x_only`` where it holds one of two."""
    return record if len(axes) == len(AXES) else f"{record}_{'_'.join(axes)}_only"


@frozen(eq=False)
class CalibrationRecord:
    """Drive (V) and measured displacement (m) of one record, sample by sample, from rest at zero.

    ``axes`` are those that it holds. Raises InputError, which names the record, where the two are
    not one good record of them.
    """

    name: str
    drive: Trace
    displacement: Trace
    axes: tuple[str, ...] = AXES

    def __attrs_post_init__(self) -> None:
        for problem in problems(self.drive, self.displacement, self.axes):
            raise InputError(f"record {self.name}: {problem}")

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
