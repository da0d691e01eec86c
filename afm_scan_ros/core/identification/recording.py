"""What a calibration record holds, checked before anything is fitted to it."""

from collections.abc import Iterator

import numpy as np
from attrs import frozen

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import AXES, Array, Trace


@frozen(eq=False)
class Recording:
    """Drive (V) and measured displacement (m) of one record, sample by sample, from rest at zero.

    Raises InputError, which names the record, where the two do not fit together.
    """

    name: str
    drive: Trace
    displacement: Trace

    def __attrs_post_init__(self) -> None:
        for problem in self._problems():
            raise InputError(f"record {self.name}: {problem}")

    @property
    def sample_period(self) -> float:
        """Seconds between samples."""
        return self.drive.sample_period

    def _problems(self) -> Iterator[str]:
        drive, displacement = self.drive, self.displacement
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
        if drive.first_sample or displacement.first_sample:
            yield "it begins in the middle of a scan; record it from its first sample"
        for quantity, trace in (("drive", drive), ("displacement", displacement)):
            yield from _bad_values(quantity, trace)


def _bad_values(quantity: str, trace: Trace) -> Iterator[str]:
    for axis in AXES:
        values = trace.axis(axis)
        wrong = np.flatnonzero(~np.isfinite(values))
        if wrong.size:
            yield f"{quantity} {axis} is {values[wrong[0]]} at sample {wrong[0]}; record it again"
        elif values.size == 0 or np.ptp(values) == 0.0:
            yield f"{quantity} {axis} never changes, so there is nothing to fit; record it again"


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
