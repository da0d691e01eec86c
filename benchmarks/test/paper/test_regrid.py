"""An image on the measured path: a known distortion is undone, and nothing is made up."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from afm_scan_bench.paper.regrid import regrid
from afm_scan_ros.core.types import Array

PLACES = np.linspace(0.0, 1.0, 41)


def surface(x: Array, y: Array) -> Array:
    return np.sin(5.0 * x + 2.0 * y) + np.cos(4.0 * y)


@given(st.floats(-0.2, 0.2), st.floats(-0.2, 0.2), st.floats(0.0, 0.1), st.floats(5.0, 60.0))
@settings(deadline=None, max_examples=25)
def test_a_known_distortion_is_undone(bend: float, shear: float, size: float, waves: float) -> None:
    u, v = np.meshgrid(np.linspace(-0.3, 1.3, 1600), np.linspace(-0.3, 1.3, 200))
    x = u + bend * u * (1.0 - u) + size * np.sin(waves * u)  # to and fro, if the wave is steep
    y = v + shear * v * (1.0 - v)
    image = regrid(x, y, surface(x, y), PLACES, PLACES, reach=0.1)
    expected = surface(*np.meshgrid(PLACES, PLACES))
    np.testing.assert_allclose(image, expected, atol=2e-3)


def test_nothing_is_drawn_where_nothing_was_scanned() -> None:
    x, y = np.meshgrid(np.linspace(0.0, 0.51, 50), np.array([0.0, 0.1, 0.21, 0.79, 0.91]))
    image = regrid(x, y, np.ones_like(x), PLACES, PLACES, reach=0.2)
    across, along = np.meshgrid(PLACES, PLACES)
    scanned = (across < 0.51) & ((along < 0.21) | ((along > 0.79) & (along < 0.91)))
    np.testing.assert_array_equal(np.isfinite(image), scanned)
    np.testing.assert_allclose(image[scanned], 1.0)
