"""The figures of merit of a scan, and the sums from which they are computed.

The error is achieved minus desired displacement at the same sample, the desired one as it was
published, with no delay, gain or offset fitted. Its rms is about zero. Figures are in SI units;
``plain`` names their units where they leave the package.
"""

from collections.abc import Mapping
from math import sqrt
from typing import Any

import numpy as np
from attrs import AttrsInstance, field, fields, frozen, has

from afm_scan_ros.core.types import Array

METRES = {"unit": "m"}


@frozen
class Figure:
    """An error over a set of samples: rms and largest, in m and as a share of the range.

    The range is the desired peak-to-peak of that axis on the lines.
    """

    rms: float = field(metadata=METRES)
    largest: float = field(metadata=METRES)
    rms_share: float
    largest_share: float
    samples: int


@frozen
class AxisError:
    """The error of one axis. Sets that hold no sample are None.

    ``all``, ``constant_speed`` and ``turnarounds`` leave out the first to-and-fro, which stands
    in ``first_line`` alone; so do ``trace`` (the constant-speed part of all traces) and ``step``
    (the smooth steps of y). ``approach`` and ``preparation`` come before the lines.
    """

    peak_to_peak: float = field(metadata=METRES)
    all: Figure | None
    constant_speed: Figure | None
    turnarounds: Figure | None
    trace: Figure | None
    step: Figure | None
    first_line: Figure | None
    approach: Figure | None
    preparation: Figure | None
    repeatability: float | None = field(metadata=METRES)


@frozen
class Tracking:
    """The figures of one scan, of its ``measured`` or its ``true`` (noise-free) displacement.

    ``mismatch`` is the difference of x between trace and retrace at equal desired position, of
    all lines but the first. ``repeatability`` of each axis is what differs from line to line: the
    rms difference of successive lines' errors about its mean, divided by the square root of two.
    """

    displacement: str
    samples: int
    lines: int
    x: AxisError
    y: AxisError
    mismatch: Figure | None


def plain(record: AttrsInstance) -> dict[str, Any]:
    """Return a record as JSON has it: its numbers in SI units, each unit in the number's name."""
    result: dict[str, Any] = {}
    for attribute in fields(type(record)):
        unit = attribute.metadata.get("unit")
        name = f"{attribute.name}_{unit}" if unit else attribute.name
        result[name] = _plain_value(getattr(record, attribute.name))
    return result


def _plain_value(value: Any) -> Any:  # noqa: ANN401 - whatever JSON can hold
    if has(type(value)):
        return plain(value)
    if isinstance(value, Mapping):
        return {str(key): _plain_value(each) for key, each in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain_value(each) for each in value]
    return value


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
