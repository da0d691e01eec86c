"""An image of a grating, registered: its positions and its figures."""

from attrs import frozen

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.imaging.grating.figures import Figure, figures_of
from afm_scan_ros.core.imaging.grating.models import Positions, positions_of
from afm_scan_ros.core.imaging.grating.registration import register
from afm_scan_ros.core.imaging.scan_image import ScanImage


@frozen(eq=False)
class Seen:
    """An image, where the tip was at each of its pixels, and what that shows of the scanner."""

    image: ScanImage
    positions: Positions
    figures: tuple[Figure, ...]


def see(image: ScanImage, pitch: float) -> Seen:
    """Register trace and retrace of an image of a grating of a ``pitch`` (m).

    Raises InputError where there is no retrace or no such grating, ScanError where the turns do not
    settle.
    """
    if image.retrace is None:
        raise InputError(f"{image.name}: holds no retrace: give an image of both directions")
    found = register(image, pitch)
    positions = positions_of(found, 2, upward=image.upward)
    return Seen(image, positions, figures_of(image, found))
