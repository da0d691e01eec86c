"""Where a model says that the scanner was at each pixel of an image."""

import numpy as np

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.imaging.grating.models import rows_of
from afm_scan_ros.core.imaging.line_drive import LineDrive
from afm_scan_ros.core.imaging.scan_image import ScanImage
from afm_scan_ros.core.model import AxisModel, ScannerModel
from afm_scan_ros.core.scanner import forward
from afm_scan_ros.core.types import Array


def predicted_positions(
    model: ScannerModel, image: ScanImage, volts_per_metre: tuple[float, float]
) -> tuple[Array, Array]:
    """Positions (lines, pixels, 2) of trace and retrace, m, zero on average.

    ``volts_per_metre`` (V/m) turn commanded positions of x and y into drives. The lines repeat, and
    no axis moves the other. Raises InputError where the time of a line is not known, or where the
    drive leaves the range of the model.
    """
    if image.line_time is None:
        raise InputError(f"{image.name}: the time of a line is not known: state it")
    line = LineDrive.of(image, volts_per_metre[0], image.line_time)
    there, back = line.at_pixels(_moved(model.axis("x"), line.drive, line.sample_period))
    rows = _rows(model, image, volts_per_metre[1], image.line_time)
    middle = 0.5 * (there.mean() + back.mean())
    both = (np.broadcast_to(each - middle, image.trace.shape) for each in (there, back))
    y = np.broadcast_to((rows - rows.mean())[:, np.newaxis], image.trace.shape)
    trace, retrace = (np.stack([x, y], axis=2) for x in both)
    return trace, retrace


def _rows(model: ScannerModel, image: ScanImage, scale: float, line_time: float) -> Array:
    """Displacement of y in each line, (lines,), a line after the drive that moves it."""
    drive = rows_of(image, scale)
    in_time = drive if image.upward else drive[::-1]
    moved = _moved(model.axis("y"), np.append(in_time, in_time[-1]), line_time)[1:]
    return moved if image.upward else moved[::-1]


def _moved(axis: AxisModel, drive: Array, period: float) -> Array:
    chain = forward(axis, period)
    return chain.apply(chain.at_rest(), np.ascontiguousarray(drive))[1]
