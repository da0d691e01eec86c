"""What learning adds to the desired displacement before a model's inverse."""

from typing import TypeAlias

import numpy as np
from attrs import field, frozen

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.trajectory import desired, phases, settle_samples, smooth_step, total_samples
from afm_scan_ros.core.types import Array, Trace

Stop: TypeAlias = int | None
"""First sample at which an operator's stop changed the trajectory; None before."""


@frozen(eq=False)
class Correction:
    """Change of the reference of one scan, m: ``x`` and ``y`` of shape (total samples,).

    The scan's error is still measured against the desired displacement.
    """

    spec: ScanSpec
    x: Array = field()
    y: Array = field()

    def __attrs_post_init__(self) -> None:
        expected = (total_samples(self.spec),)
        for name, values in (("x", self.x), ("y", self.y)):
            if values.shape != expected or not np.isfinite(values).all():
                raise InputError(
                    f"the correction of {name} has shape {values.shape}: give {expected[0]} finite"
                    " values, as the scan has samples"
                )

    @classmethod
    def none(cls, spec: ScanSpec) -> "Correction":
        """Return the correction that changes nothing."""
        nothing = np.zeros(total_samples(spec))
        return cls(spec, nothing, nothing)

    def reference(self) -> Trace:
        """Return the reference of the whole scan, m."""
        return self.follow(None, desired(self.spec, 0, len(self.x)))[1]

    def follow(self, stop: Stop, block: Trace) -> tuple[Stop, Trace]:
        """Return the state after a desired block, and its reference; it fades out at a stop."""
        first, count = block.first_sample, len(block.x)
        if stop is None:
            stop = self._stop_in(block)
        here = slice(first, first + count)
        x, y = self.x[here], self.y[here]
        if stop is not None:
            age = np.arange(first, first + count) - stop
            fading = 1.0 - smooth_step(age / settle_samples(self.spec))
            x, y = fading * x, fading * y
        return stop, Trace(first, block.sample_period, block.x + x, block.y + y)

    def _stop_in(self, block: Trace) -> Stop:
        """Return the first sample of a block that is not the scan's own."""
        planned = desired(self.spec, block.first_sample, len(block.x))
        other = np.flatnonzero((planned.x != block.x) | (planned.y != block.y))
        return block.first_sample + int(other[0]) if other.size else None


def window(spec: ScanSpec) -> Array:
    """Share of a correction that is used at each sample: 1 on the lines, 0 at both ends."""
    where = phases(spec)
    samples = np.arange(where.total)
    rise = smooth_step((samples - where.approach.start) / len(where.approach))
    fall = smooth_step((samples - where.lines.stop) / (len(where.settle) - 1))
    return np.asarray(rise * (1.0 - fall))
