"""Desired against achieved of a record that is no scan: one that was imported."""

import numpy as np
from attrs import field, frozen

from afm_scan_ros.bag.reader import ScanRecording
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.metrics.figures import METRES
from afm_scan_ros.core.types import AXES, Array

DESIRED, ACHIEVED = "desired_displacement", "achieved_displacement"


@frozen
class AxisComparison:
    """Achieved minus desired of one axis over a whole record, nothing fitted.

    ``mean`` is the part of ``rms`` that a sensor's arbitrary zero makes, ``spread`` the rest.
    """

    peak_to_peak: float = field(metadata=METRES)
    rms: float = field(metadata=METRES)
    largest: float = field(metadata=METRES)
    mean: float = field(metadata=METRES)
    spread: float = field(metadata=METRES)


@frozen
class Comparison:
    """The figures of a record; None for an axis that was not measured."""

    bag: str
    record: str
    samples: int
    x: AxisComparison | None
    y: AxisComparison | None
    warnings: tuple[str, ...]


def comparable(recording: ScanRecording) -> bool:
    """Whether a recording is no scan, yet has both displacements."""
    return recording.info.spec is None and {DESIRED, ACHIEVED} <= recording.topics.keys()


def compare(recording: ScanRecording) -> Comparison:
    """Compare a record's displacements. Raises InputError for gaps, and where it is cut short."""
    desired, achieved = recording.whole(DESIRED), recording.whole(ACHIEVED)
    samples = min(desired.x.size, achieved.x.size)
    missing = recording.info.total_samples - samples
    if missing:
        mend = "; ".join((*recording.warnings, "import again"))
        raise InputError(f"{recording.path}: the last {missing} samples are missing; {mend}")
    x, y = (_compare(desired.axis(axis), achieved.axis(axis)) for axis in AXES)
    info = recording.info
    return Comparison(str(recording.path), info.pattern, samples, x, y, recording.warnings)


def _compare(desired: Array, achieved: Array) -> AxisComparison | None:
    if not (desired.any() or achieved.any()):
        return None
    error = achieved - desired
    return AxisComparison(
        peak_to_peak=float(np.ptp(desired)),
        rms=float(np.sqrt(np.mean(error**2))),
        largest=float(np.abs(error).max()),
        mean=float(error.mean()),
        spread=float(error.std()),
    )
