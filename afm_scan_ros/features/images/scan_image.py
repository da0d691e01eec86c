"""An image of a to-and-fro scan as programs for scanning-probe microscopy store it."""

from numbers import Real

import numpy as np
from attrs import field, frozen
from attrs.converters import optional

from afm_scan_ros.core.arguments import refuse_masked
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import Array

SMALLEST = 8
"""Lines and pixels, below which nothing in an image can be measured."""


def _floats(values: Array) -> Array:
    refuse_masked("an image", values)
    try:
        return np.asarray(values, dtype=float)
    except (TypeError, ValueError):
        raise InputError("trace and retrace: give heights as numbers, (lines, pixels)") from None


def _real(value: object) -> bool:
    return isinstance(value, Real) and not isinstance(value, bool)


def refuse_gaps(what: str, values: Array) -> None:
    """Raise InputError on ``what`` where a value of an image is not a finite number."""
    if not np.all(np.isfinite(values)):
        line, pixel = (int(k) for k in np.argwhere(~np.isfinite(values))[0])
        raise InputError(
            f"{what} not a finite number in line {line}, pixel {pixel}: give an image without gaps"
        )


@frozen(eq=False)
class ScanImage:
    """One channel of one image: ``trace`` and ``retrace`` of the same lines, (lines, pixels) each.

    Row 0 has the lowest commanded y and column 0 the lowest commanded x, also in the retrace. Row
    0 was scanned first where ``upward``. ``range_x`` and ``range_y`` (m) are commanded and hold
    all pixels; ``overscan`` is the motion beyond each end of a line over ``range_x``.
    ``line_time`` (s) is that of trace and retrace together, None where no file states it.
    ``unit`` is that of the values. ``assumptions`` are sentences on what the file does not state
    and was taken instead. Raises InputError for shapes that differ or are too small,
    values that are not finite, and ranges or times that are not positive.
    """

    trace: Array = field(converter=_floats)
    retrace: Array | None = field(converter=optional(_floats))
    range_x: float
    range_y: float
    line_time: float | None = None
    upward: bool = True
    overscan: float = 0.0
    channel: str = "Topography"
    unit: str = "m"
    name: str = "image"
    assumptions: tuple[str, ...] = ()

    def __attrs_post_init__(self) -> None:
        self._refuse_unpositive("range_x", "m")
        self._refuse_unpositive("range_y", "m")
        if self.line_time is not None:
            self._refuse_unpositive("line_time", "s")
        if not (_real(self.overscan) and 0.0 <= float(self.overscan) < 1.0):
            raise InputError(
                f"{self.name}: overscan = {self.overscan!r}: give a share of range_x, from 0 to"
                " below 1"
            )
        if self.trace.ndim != 2 or min(self.trace.shape) < SMALLEST:  # noqa: PLR2004 - a plane
            raise InputError(
                f"{self.name}: an image of shape {self.trace.shape}: give at least {SMALLEST}"
                f" lines of {SMALLEST} pixels"
            )
        if self.retrace is not None and np.shape(self.retrace) != self.trace.shape:
            raise InputError(
                f"{self.name}: trace {self.trace.shape} and retrace {np.shape(self.retrace)}"
                " differ: give both of one scan"
            )
        for which, values in (("trace", self.trace), ("retrace", self.retrace)):
            if values is not None:
                refuse_gaps(f"{self.name}: the {which} is", values)

    def _refuse_unpositive(self, name: str, unit: str) -> None:
        value = getattr(self, name)
        if not (_real(value) and 0.0 < float(value) < np.inf):
            raise InputError(f"{self.name}: {name} = {value!r}: give a number above 0, in {unit}")

    @property
    def lines(self) -> int:
        """Number of lines."""
        return int(self.trace.shape[0])

    @property
    def pixels(self) -> int:
        """Pixels of a line."""
        return int(self.trace.shape[1])


def both_sides(image: ScanImage) -> tuple[Array, Array]:
    """Return trace and retrace of an image; raises InputError where it has no retrace."""
    if image.retrace is None:
        raise InputError(f"{image.name}: holds no retrace: give an image of both directions")
    return image.trace, image.retrace


def line_time_of(image: ScanImage) -> float:
    """Return the time of trace and retrace together; raises InputError where it is not known."""
    if image.line_time is None:
        raise InputError(
            f"{image.name}: the time of a line is not known: give line_time, or --line-time"
        )
    return image.line_time
