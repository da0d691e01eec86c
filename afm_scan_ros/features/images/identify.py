"""A scanner without a displacement sensor: a model from images of a grating, images corrected."""

from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
from attrs import evolve, frozen
from numpy.typing import ArrayLike

from afm_scan_ros.core.arguments import IMAGE, IMAGES, MODEL, all_of_type, of_type, positive
from afm_scan_ros.core.effects.hysteresis.everett import BeyondRangeError
from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.types import Array, ProgressCallback, Step
from afm_scan_ros.features.images.grating.models import Positions, model_of
from afm_scan_ros.features.images.grating.registered_image import (
    ImageQuantity,
    RegisteredImage,
    accurate_ones,
    both_directions,
    register_image,
)
from afm_scan_ros.features.images.positions import common_rectangle, predicted_positions, regridded
from afm_scan_ros.features.images.scan_image import ScanImage, both_sides, line_time_of
from afm_scan_ros.model import Model

ACCURACY = 0.0035
"""Accuracy of a pitch over an image, which published corrections of gratings reach."""


@frozen(eq=False)
class ImageIdentification:
    """What images of a grating show: the ``model`` of x and y, and of each image its ``positions``.

    ``images`` are those that were used, in the order given. ``refused`` has a sentence for each of
    the others: its name and why. ``corrected`` are the images on regular grids of these positions,
    without the line scanned first, whose positions are not known; None where the scanner turned
    back within a line, so that no grid holds the image. ``figures`` are those of each image, with
    95 % intervals; ``drift`` those that images upwards and downwards show together.
    """

    model: Model
    images: tuple[ScanImage, ...]
    positions: tuple[Positions, ...]
    corrected: tuple[ScanImage | None, ...]
    figures: tuple[tuple[ImageQuantity, ...], ...]
    drift: tuple[ImageQuantity, ...]
    refused: tuple[str, ...] = ()


def identify_from_images(
    images: Iterable[ScanImage],
    pitch: float,
    volts_per_metre: ArrayLike = 1e6,
    progress: ProgressCallback | None = None,
    accuracy: float = ACCURACY,
) -> ImageIdentification:
    """Identify a scanner from trace and retrace of images of a grating of known pitch.

    The grating repeats in two directions at right angles. The cells' own shape needs not be known.

    Parameters
    ----------
    images
        Each of at least three by three whole cells, and of a scan that nothing corrected.
    pitch
        Distance of neighbouring cells, m, the same in both directions; of a chessboard that along a
        row.
    volts_per_metre
        Drive over commanded position, of both axes or of x and y. By default a drive of 1 V stands
        for a commanded position of 1 µm.
    progress
        Is called with what is being done: text that also has how many images are ``done`` of a
        ``total`` while their cells are found. ``timed(print)`` shows it with the time.
    accuracy
        Relative error of the distance of a pitch, rms over the image, that one image must reach
        with 95 % certainty. The other images may err by twice as much, in y only those as large.

    Returns
    -------
    ImageIdentification
        The model, the positions of each image that was used, and why the others were refused: an
        image that shows no such grating, whose positions do not settle or are not accurate enough.

    Raises
    ------
    InputError
        Where an image holds no retrace or states no time of a line; where all images are refused,
        for the reason of the first.
    ScanError
        Where a fit does not converge.

    Notes
    -----
    x has its gain and hysteresis, fitted to all images. Images of one line rate cannot separate
    hysteresis from a lag or from creep: then all that differs between trace and retrace is taken
    for hysteresis. Where line rates differ by a factor of two, creep and a resonance or a lag are
    sought in the same fit. y has a gain: that of the largest image, or the mean of the largest ones
    upwards and downwards, which is free of drift.

    Examples
    --------
    >>> import numpy as np
    >>> import afm_scan_ros as afm
    >>> x, y = np.meshgrid(np.linspace(-18e-6, 18e-6, 128), np.linspace(-18e-6, 18e-6, 128))
    >>> heights = 50e-9 * np.cos(2e6 * np.pi * (x + 0.1 * y) / 6) ** 3
    >>> heights += 50e-9 * np.cos(2e6 * np.pi * (y - 0.1 * x) / 6) ** 3
    >>> image = afm.ScanImage(heights, heights, range_x=40e-6, range_y=40e-6, line_time=1.0)
    >>> found = afm.identify_from_images([image], pitch=6e-6 / np.hypot(1.0, 0.1))
    >>> bool(abs(np.ptp(found.positions[0].trace[64, :, 0]) / 36e-6 - 1.0) < 1e-3)
    True
    """
    report = progress or (lambda _: None)
    given = all_of_type(ScanImage, "images", images, IMAGES)
    if not given:
        raise InputError("no image is given: give one at least")
    pitch = positive("pitch", pitch, "in m, as 10e-6")
    accuracy = positive("accuracy", accuracy, "as 0.0035 for 0.35 % of a pitch")
    scales = _scales(volts_per_metre)
    for image in given:
        both_sides(image)
        line_time_of(image)
    seen, errors = _registered(given, pitch, report)
    used, inaccurate = accurate_ones(seen, accuracy)
    errors += inaccurate
    if not used:
        raise errors[0]
    found = identified_from(used, scales, report)
    return evolve(found, refused=tuple(str(error) for error in errors))


def _registered(
    images: Sequence[ScanImage], pitch: float, report: ProgressCallback
) -> tuple[list[RegisteredImage], list[InputError | ScanError]]:
    """Register images; return the errors of those that are refused."""
    seen: list[RegisteredImage] = []
    errors: list[InputError | ScanError] = []
    for number, image in enumerate(images):
        doing = f"finding the cells of the grating in {image.name}"
        report(Step(doing, number, len(images), more=True))
        try:
            seen.append(register_image(image, pitch))
        except InputError as error:
            errors.append(InputError(f"{image.name}: {error}"))
        except ScanError as error:
            errors.append(error)
    return seen, errors


def identified_from(
    seen: Sequence[RegisteredImage],
    scales: tuple[float, float],
    progress: ProgressCallback,
) -> ImageIdentification:
    """Identify a scanner from images that were registered; otherwise as ``identify_from_images``.

    ``scales`` (V/m) are those of x and y.
    """
    scanner = model_of([s.image for s in seen], [s.positions for s in seen], scales, progress)
    names = ", ".join(each.image.name for each in seen)
    corrected = (_corrected_or_none(each) for each in seen)
    return ImageIdentification(
        Model(scanner, f"identified from {names}"),
        tuple(each.image for each in seen),
        tuple(each.positions for each in seen),
        tuple(corrected),
        tuple(each.figures for each in seen),
        both_directions(seen),
    )


def _corrected_or_none(seen: RegisteredImage) -> ScanImage | None:
    found = seen.positions
    try:
        return _corrected(seen.image, found.trace, found.retrace, found.known)
    except InputError:
        return None


def correct_image(model: Model, image: ScanImage, volts_per_metre: ArrayLike = 1e6) -> ScanImage:
    """Return an image on a regular grid of the positions that a model predicts.

    Parameters
    ----------
    model
        Of x and y.
    image
        Trace and retrace, with the time of a line.
    volts_per_metre
        As in ``identify_from_images``.

    Returns
    -------
    ScanImage
        Of the same size, less the line before which the scanner's path is not known.

    Raises
    ------
    InputError
        Where the image's drive leaves the range of the model, or where the image holds no retrace
        or states no time of a line.

    Examples
    --------
    >>> import numpy as np
    >>> import afm_scan_ros as afm
    >>> slope = np.tile(np.linspace(0.0, 1e-7, 64), (64, 1))
    >>> image = afm.ScanImage(slope, slope, range_x=10e-6, range_y=10e-6, line_time=1.0)
    >>> corrected = afm.correct_image(afm.load_model(), image, volts_per_metre=1.6e5)
    >>> corrected.trace.shape
    (63, 64)
    """
    of_type(Model, "model", model, MODEL)
    both_sides(of_type(ScanImage, "image", image, IMAGE))
    try:
        found = predicted_positions(model.scanner, image, _scales(volts_per_metre))
    except BeyondRangeError as error:
        raise InputError(
            f"{image.name}: its drive reaches {error.value:.4g} V, and the model was identified to"
            f" {error.limit:.4g} V: identify it from an image as large"
        ) from None
    return _corrected(image, *found, slice(1, None) if image.upward else slice(None, -1))


def _corrected(image: ScanImage, trace: Array, retrace: Array, known: slice) -> ScanImage:
    """Put both directions on one grid. Its first and last points are the middles of pixels.

    The line scanned first is not among the lines that are ``known``, and is left out.
    """
    places = trace[known], retrace[known]
    area, lines = common_rectangle(places), len(places[0])
    pairs = zip(both_sides(image), places, strict=True)
    there, back = (regridded(heights[known], place, area) for heights, place in pairs)
    return evolve(
        image,
        trace=there,
        retrace=back,
        range_x=(area.right - area.left) * image.pixels / (image.pixels - 1),
        range_y=(area.top - area.bottom) * lines / (lines - 1),
        overscan=0.0,
        name=f"{Path(image.name).stem}, corrected",
    )


def _scales(volts_per_metre: ArrayLike) -> tuple[float, float]:
    try:
        x, y = np.broadcast_to(np.asarray(volts_per_metre, dtype=float), 2).tolist()
    except (TypeError, ValueError):
        x = y = np.nan
    if not (0.0 < x < np.inf and 0.0 < y < np.inf):
        raise InputError(
            f"volts_per_metre is {volts_per_metre!r}: give a positive number, V/m, or one for each"
            " of x and y"
        )
    return x, y
