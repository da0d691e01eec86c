"""Samples: heights where they were put, between them straight lines, and nothing beyond."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.simulation.sample import Grating, HeightMap

places = st.floats(-50e-6, 50e-6)


@given(places, places, st.floats(-1.5, 1.5), st.integers(-3, 3))
@settings(deadline=None)
def test_a_grating_repeats_across_and_not_along(
    x: float, y: float, angle: float, turns: int
) -> None:
    grating = Grating(angle=angle)
    here = grating.height(np.array([x]), np.array([y]))
    step = turns * grating.pitch
    across = grating.height(
        np.array([x + step * np.cos(angle)]), np.array([y + step * np.sin(angle)])
    )
    along = grating.height(
        np.array([x - step * np.sin(angle)]), np.array([y + step * np.cos(angle)])
    )
    np.testing.assert_allclose([across, along], [here, here], atol=1e-13)
    assert 0.0 <= here[0] <= grating.thickness


def test_half_of_a_grating_is_chrome() -> None:
    grating = Grating()
    x = np.linspace(-8e-6, 8e-6, 4001)[:-1]
    assert grating.height(x, 0.0 * x).mean() == pytest.approx(0.5 * grating.thickness, rel=1e-3)
    assert grating.height(np.array([0.0, 8e-6]), np.zeros(2)) == pytest.approx([100e-9, 0.0])


@given(st.lists(st.floats(-1.0, 1.0), min_size=4, max_size=4), st.data())
@settings(deadline=None)
def test_bilinear_is_exact_for_a_twisted_plane(
    coefficients: list[float], data: st.DataObject
) -> None:
    a, b, c, d = coefficients
    y, x = np.meshgrid(np.linspace(-2.0, 2.0, 5), np.linspace(-3.0, 3.0, 7), indexing="ij")
    surface = HeightMap(a + b * x + c * y + d * x * y, width=6.0)
    at_x = data.draw(st.lists(st.floats(-3.0, 3.0), min_size=3, max_size=3).map(np.array))
    at_y = data.draw(st.lists(st.floats(-2.0, 2.0), min_size=3, max_size=3).map(np.array))
    expected = a + b * at_x + c * at_y + d * at_x * at_y
    np.testing.assert_allclose(surface.height(at_x, at_y), expected, atol=1e-12)


def test_beyond_the_map_is_no_height() -> None:
    surface = HeightMap(np.zeros((3, 3)), width=2e-6)
    with pytest.raises(ScanError, match=r"y = 1\.5 µm lies beyond the sample, which ends at 1 µm"):
        surface.height(np.zeros(2), np.array([0.0, 1.5e-6]))


@pytest.mark.parametrize(
    ("heights", "reason"),
    [
        (np.zeros(4), "needs rows and columns"),
        (np.zeros((1, 4)), "needs rows and columns"),
        (np.array([[0.0, 1.0], [np.nan, 0.0]]), "row 1, column 0 is not a finite number"),
    ],
)
def test_bad_maps_are_refused(heights: np.ndarray, reason: str) -> None:
    with pytest.raises(InputError, match=reason):
        HeightMap(heights, 1.0)
