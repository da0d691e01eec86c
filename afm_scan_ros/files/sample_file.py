"""A sample's heights from a file: an array of numbers, or any picture."""

from pathlib import Path

import numpy as np

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import Array
from afm_scan_ros.files.arrays import read_npy
from afm_scan_ros.files.records import naming
from afm_scan_ros.simulation.sample import HeightMap

LARGEST = 2**26  # bytes of a file
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
        picture = imread(path)
    except Exception as error:  # Pillow raises whatever a damaged picture makes it run into
        raise InputError(f"{path}: not a picture that can be read: {error}") from error
    scale = np.iinfo(picture.dtype).max if picture.dtype.kind == "u" else 1.0
    values = np.asarray(picture, dtype=np.float64) / scale
    if values.ndim == 2:  # noqa: PLR2004 - grey
        return values
    if values.shape[2] < len(LUMINANCE):  # grey and alpha
        return np.ascontiguousarray(values[..., 0])
    result: Array = values[..., :3] @ np.array(LUMINANCE)
    return result
