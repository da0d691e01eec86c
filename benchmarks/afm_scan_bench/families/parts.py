"""The error of a scan's lines as offset, gain and shape, which an image shows differently."""

import numpy as np
from attrs import frozen

from afm_scan_ros.core.metrics import Scan
from afm_scan_ros.core.trajectory import phases, sample_kinds


@frozen
class ErrorParts:
    """Error of x at constant speed, m, but ``gain`` (1); all rms but offset and gain.

    ``offset`` and ``gain`` are of the straight line of the error against the desired position,
    ``shape`` is what it leaves.
    """

    rms: float
    offset: float
    gain: float
    shape: float


def error_parts(done: Scan) -> ErrorParts:
    """Split the true error of x, the first to-and-fro left out."""
    spec, where = done.spec, phases(done.spec).lines
    second = where.start + spec.samples_per_line
    kinds = sample_kinds(spec, second, where.stop - second)
    kept = kinds.trace | kinds.retrace
    wanted, moved = (signal[second : where.stop][kept] for signal in (done.desired.x, done.true.x))
    error = moved - wanted
    gain, offset = np.polyfit(wanted, error, 1)
    shape = error - np.polyval([gain, offset], wanted)
    rms, left = (float(np.sqrt(np.mean(each**2))) for each in (error, shape))
    return ErrorParts(rms, float(offset), float(gain), left)
