"""Sums that an error's figures need, in constant memory."""

from math import sqrt

import numpy as np
from attrs import frozen

from afm_scan_ros.core.metrics.figures import Figure
from afm_scan_ros.core.types import Array


@frozen
class ErrorSum:
    """How many errors there were, the sum of their squares, and the largest."""

    count: int = 0
    squares: float = 0.0
    largest: float = 0.0

    def plus(self, error: Array) -> "ErrorSum":
        """Return the sums with the errors of shape (n,) added."""
        if not error.size:
            return self
        largest = max(self.largest, float(np.abs(error).max()))
        return ErrorSum(self.count + error.size, self.squares + float(error @ error), largest)

    def rms(self) -> float:
        """Root of the mean square about zero; there must be samples."""
        return sqrt(self.squares / self.count)

    def figure(self, full: float) -> Figure | None:
        """Return the figures for an axis of desired peak-to-peak ``full``; None without samples."""
        if not self.count:
            return None
        rms = self.rms()
        return Figure(rms, self.largest, rms / full, self.largest / full, self.count)
