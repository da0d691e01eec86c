"""Laws of the lattice: the pitch stated is the grating's own one, no multiple and no diagonal."""

import re

import numpy as np
import pytest

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.imaging.grating.features import levelled
from afm_scan_ros.core.imaging.grating.rough_motion import first_motion
from afm_scan_ros.core.imaging.scan_image import ScanImage
from afm_scan_ros.core.types import Array

SIZE, PITCH = 192, 3e-6
KINDS = ("squares", "discs", "chessboard")
MULTIPLES = (np.sqrt(2.0), 2.0, np.sqrt(5.0), 3.0, 4.0)


def cell(kind: str, u: Array, v: Array, width: float) -> Array:
    """Distance inside a feature's edge, in cells."""
    u, v = u - np.rint(u), v - np.rint(v)
    if kind == "chessboard":
        nearer = np.minimum(0.25 - np.abs(np.abs(u) - 0.25), 0.25 - np.abs(np.abs(v) - 0.25))
        return np.asarray(np.where(u * v > 0.0, nearer, -nearer))
    away = np.hypot(u, v) if kind == "discs" else np.maximum(np.abs(u), np.abs(v))
    return np.asarray(0.5 * width - away)


def drawn(kind: str, seed: int) -> ScanImage:
    """Draw a grating with missing cells and noise, seen by a scanner with a loop and a bend."""
    rng = np.random.default_rng(seed)
    side = PITCH * rng.uniform(6.0, 11.0)
    place = (2.0 * np.arange(SIZE) + 1.0) / SIZE - 1.0
    angle, loop, bend = rng.uniform(-0.14, 0.14), rng.uniform(0.0, 0.2), rng.uniform(-0.1, 0.1)
    width, depth = rng.uniform(0.4, 0.65), rng.choice([-1.0, 1.0])
    missing = rng.random((32, 32)) < rng.uniform(0.0, 0.04)
    scale, sides = rng.uniform(0.9, 1.1), []
    for sign in (-1.0, 1.0):
        x = 0.5 * side * scale * (place + sign * 0.5 * loop * (1.0 - place**2))
        y = 0.5 * side * scale * (place + bend * (1.0 - place**2))
        x, y = np.meshgrid(x, y)
        u = (x * np.cos(angle) + y * np.sin(angle)) / PITCH
        v = (y * np.cos(angle) - x * np.sin(angle)) / PITCH
        whole = np.rint(u).astype(int) % 32, np.rint(v).astype(int) % 32
        rise = np.clip(0.5 + cell(kind, u, v, width) / 0.05, 0.0, 1.0) * ~missing[whole]
        noise = rng.normal(0.0, 0.05, rise.shape) + rng.normal(0.0, 0.05, (SIZE, 1))
        sides.append(100e-9 * (depth * rise + noise))
    return ScanImage(sides[0], sides[1], side, side, 1.0)


def period_of(image: ScanImage, pitch: float) -> float:
    """Distance of neighbouring cells over the pitch that the image was found to have."""
    assert image.retrace is not None
    heights = [levelled(image.trace), levelled(image.retrace)]
    return first_motion(image, heights, pitch)[2]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", range(4))
def test_the_grating_s_own_pitch_is_accepted(kind: str, seed: int) -> None:
    expected = np.sqrt(0.5) if kind == "chessboard" else 1.0
    assert period_of(drawn(kind, seed), PITCH) == pytest.approx(expected)


@pytest.mark.parametrize("seed", range(4))
def test_a_chessboard_s_pitch_may_be_the_side_of_its_cell(seed: int) -> None:
    assert period_of(drawn("chessboard", seed), PITCH / np.sqrt(2.0)) == 1.0


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(
    "seed", [0, 1, *(pytest.param(n, marks=pytest.mark.evidence) for n in (2, 3))]
)
def test_a_multiple_and_a_diagonal_are_refused(kind: str, seed: int) -> None:
    """The error names the period that the image shows, as long as the scan size is right.

    Every image tries half of the multiples.
    """
    image = drawn(kind, seed)
    for multiple in MULTIPLES[seed % 2 :: 2]:
        with pytest.raises(InputError, match="repeats every") as refused:
            period_of(image, multiple * PITCH)
        named = re.search(r"every ([\d.]+) µm of a scan", str(refused.value))
        assert named is not None
        assert float(named[1]) == pytest.approx(1e6 * PITCH, rel=0.25)
