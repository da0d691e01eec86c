"""Laws of the lattice: the pitch stated is the grating's own one, no multiple and no diagonal."""

import re

import numpy as np
import pytest
from attrs import evolve

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import Array
from afm_scan_ros.features.images.grating.features import Cells, cells_of, lattice_of, levelled
from afm_scan_ros.features.images.grating.rough_motion import first_motion
from afm_scan_ros.features.images.scan_image import ScanImage

SIZE, PITCH = 192, 3e-6
KINDS = ("squares", "discs", "chessboard")
SEEDS = [0, 1, *(pytest.param(n, marks=pytest.mark.evidence) for n in (2, 3))]
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
@pytest.mark.parametrize("seed", SEEDS)
def test_the_grating_s_own_pitch_is_accepted(kind: str, seed: int) -> None:
    expected = np.sqrt(0.5) if kind == "chessboard" else 1.0
    assert period_of(drawn(kind, seed), PITCH) == pytest.approx(expected)


@pytest.mark.parametrize("seed", SEEDS)
def test_a_chessboard_s_pitch_may_be_the_side_of_its_cell(seed: int) -> None:
    assert period_of(drawn("chessboard", seed), PITCH / np.sqrt(2.0)) == 1.0


@pytest.mark.parametrize("seed", SEEDS)
def test_between_both_readings_the_heights_of_a_chessboard_decide(seed: int) -> None:
    """A range that is 0.84 of the commanded one lies between a row and a diagonal."""
    image = drawn("chessboard", seed)
    nominal = 2.0**0.25 * period_seen(image)
    assert period_of(image, nominal * PITCH) == pytest.approx(np.sqrt(0.5))
    place = 2.0 * np.pi * np.arange(SIZE) / SIZE
    waves = 1e-7 * np.add.outer(np.sin(8.0 * place), np.sin(8.0 * place))
    assert period_of(ScanImage(waves, waves, 8.0, 8.0, 1.0), 2.0**0.25) == 1.0


def period_seen(image: ScanImage) -> float:
    """Distance of neighbouring black squares of a chessboard along the diagonal, over PITCH."""
    pixels = (PITCH / image.range_y * image.lines, PITCH / image.range_x * image.pixels)
    return lattice_of(levelled(image.trace), pixels).period


@pytest.mark.parametrize(
    ("shape", "bend"), [((3, 3), True), ((3, 2), False), ((2, 6), False), ((4, 3), True)]
)
def test_cells_must_show_how_both_directions_bend(shape: tuple[int, int], *, bend: bool) -> None:
    numbers = np.argwhere(np.ones(shape))
    assert Cells(numbers, numbers.astype(float)).show_bending is bend


def image_of_discs(count: int) -> Array:
    """Heights of three by three cells, of which so many have a disc, in all rows and columns."""
    column, row = np.meshgrid(np.arange(SIZE), np.arange(SIZE))
    third, heights = SIZE / 3.0, np.zeros((SIZE, SIZE))
    for i, k in [(0, 1), (1, 0), (1, 1), (1, 2), (2, 1), (2, 2)][:count]:
        heights[np.hypot(row - third * (i + 0.5), column - third * (k + 0.5)) < 0.25 * third] = 1.0
    return heights


def test_five_cells_are_too_few_and_six_are_not() -> None:
    vectors = np.diag([SIZE / 3.0, SIZE / 3.0])
    assert len(cells_of([image_of_discs(6)], vectors)[0]) == 6
    with pytest.raises(InputError, match=r"are too few \(5\)"):
        cells_of([image_of_discs(5)], vectors)


@pytest.mark.parametrize("seed", SEEDS)
def test_large_particles_do_not_hide_the_lattice(seed: int) -> None:
    """Particles ten times as high as the cells, over two hundredths of the image."""
    image = drawn("discs", seed)
    rng = np.random.default_rng(seed)
    dusty = image.trace.copy()
    side = round(0.1 * SIZE)
    for row, column in rng.integers(0, SIZE - side, (2, 2)):
        dusty[row : row + side, column : column + side] += 1e-6
    assert period_of(evolve(image, trace=dusty), PITCH) == pytest.approx(1.0)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", SEEDS)
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
