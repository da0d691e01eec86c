"""What is written to files of images: channels of one image, and signals of one scan."""

import numpy as np
from attrs import field, frozen
from attrs.validators import gt

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.imaging.scan_image import ScanImage
from afm_scan_ros.core.types import Array


@frozen(eq=False)
class ImageChannel:
    """One direction of one channel: ``values`` (lines, pixels) in ``unit``.

    Row 0 has the lowest y and column 0 the lowest x, also in a retrace. ``range_x`` and ``range_y``
    (m) hold all pixels, from ``left`` and ``bottom`` (m) on. ``direction`` is ``trace`` or
    ``retrace``, empty for what belongs to neither. Raises InputError for values that are no plane
    or not finite, and ValueError for ranges that are not positive.
    """

    name: str
    unit: str
    values: Array
    range_x: float = field(validator=gt(0.0))
    range_y: float = field(validator=gt(0.0))
    direction: str = ""
    left: float = 0.0
    bottom: float = 0.0

    def __attrs_post_init__(self) -> None:
        if self.values.ndim != 2 or not self.values.size:  # noqa: PLR2004 - a plane
            raise InputError(f"{self.title}: an image of shape {self.values.shape}: give a plane")
        if not np.all(np.isfinite(self.values)):
            line, pixel = (int(k) for k in np.argwhere(~np.isfinite(self.values))[0])
            raise InputError(
                f"{self.title}: not a finite number in line {line}, pixel {pixel}: give an image"
                " without gaps"
            )

    @property
    def title(self) -> str:
        """Name and direction, as ``Topography (trace)``."""
        return f"{self.name} ({self.direction})" if self.direction else self.name


@frozen(eq=False)
class Signal:
    """Samples of one scan against time, shape (n,): ``name`` as ``desired_x``, in ``unit``."""

    name: str
    unit: str
    values: Array


def image_channels(image: ScanImage) -> tuple[ImageChannel, ...]:
    """Return the trace of an image, and its retrace where there is one."""
    sides = (("trace", image.trace), ("retrace", image.retrace))
    return tuple(
        ImageChannel(image.channel, image.unit, values, image.range_x, image.range_y, direction)
        for direction, values in sides
        if values is not None
    )
