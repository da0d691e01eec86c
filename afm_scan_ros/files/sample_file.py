"""A sample's heights from a file: an array of numbers, or any picture."""

import warnings
from pathlib import Path

import numpy as np

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import Array
from afm_scan_ros.files.arrays import read_npy
from afm_scan_ros.files.records import naming
from afm_scan_ros.simulation.sample import HeightMap

PICTURES = ("PNG", "JPEG", "TIFF", "BMP", "GIF", "WEBP", "PPM")
"""Formats of pictures; others may run a program, as that of PostScript does."""
LARGEST = 2**26  # bytes of a file
MOST_PIXELS = 2**24
"""Pixels of a picture, more than the samples of any line see of it."""
LUMINANCE = (0.2126, 0.7152, 0.0722)  # of red, green and blue, ITU-R BT.709


def load_sample(path: Path, width: float, white: float) -> HeightMap:
    """Read a height map whose first and last columns are ``width`` (m) apart.

    An ``.npy`` file holds heights in m, row 0 at the lowest y. Of a picture, top row first too,
    black is height 0 and white is ``white`` (m). Raises InputError naming the file.
    """
    if not path.is_file():
        raise InputError(f"{path}: no such file; give a .npy array or a picture")
    if path.stat().st_size > LARGEST:
        raise InputError(f"{path}: over {LARGEST >> 20} MB; give a smaller map")
    heights = _array(path) if path.suffix == ".npy" else white * _brightness(path)
    with naming(path):
        return HeightMap(heights, width)


def _array(path: Path) -> Array:
    values = read_npy(path)
    if values.dtype.kind not in "fiu":
        raise InputError(f"{path}: an array of {values.dtype}, not of numbers")
    return np.asarray(values, dtype=np.float64)


def _brightness(path: Path) -> Array:
    """Return 0 for black to 1 for white, shape (rows, columns)."""
    from matplotlib.image import imread  # noqa: PLC0415 - slow to import, needed only here

    try:
        _refuse_large(path)
        picture = imread(path)
    except Exception as error:  # Pillow raises whatever a damaged picture makes it run into
        raise InputError(f"{path}: not a picture that can be read: {error}") from error
    scale = np.iinfo(picture.dtype).max if picture.dtype.kind == "u" else 1.0
    if picture.ndim == 2:  # noqa: PLR2004 - grey
        return np.asarray(picture, dtype=np.float64) / scale
    weights = LUMINANCE if picture.shape[2] >= len(LUMINANCE) else (1.0,)  # grey and alpha
    values = np.zeros(picture.shape[:2])
    for colour, weight in enumerate(weights):
        values += (weight / scale) * picture[..., colour]
    return values


def _refuse_large(path: Path) -> None:
    """Raise ValueError for a picture that states more pixels than a sample needs."""
    from PIL import Image  # noqa: PLC0415 - as matplotlib's reader

    with warnings.catch_warnings(action="ignore"), Image.open(path, formats=PICTURES) as picture:
        columns, rows = picture.size
    if columns * rows > MOST_PIXELS:
        raise ValueError(f"{columns} by {rows} pixels, over {MOST_PIXELS} in all: scale it down")
