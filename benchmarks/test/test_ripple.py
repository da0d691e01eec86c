"""Ripple along a line, measured in an image of a grating: what was put in comes out."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from afm_scan_bench.paper.ripple import LinePath, Ripple, line_path
from afm_scan_ros.simulation.sample import Grating

SIZE = 40e-6
COLUMNS = SIZE * (np.arange(200) + 0.5) / 200
ROWS = np.linspace(0.0, SIZE, 128)
X, Y = np.meshgrid(COLUMNS, ROWS)


@given(
    st.floats(0.2e-6, 3e-6),
    st.floats(350.0, 600.0),
    st.floats(0.0, 2.0 * np.pi),
    st.floats(-2e-6, 2e-6),
)
@settings(deadline=None, max_examples=12)
def test_a_ripple_is_found_also_where_the_tip_goes_back(
    amplitude: float, frequency: float, phase: float, bend: float
) -> None:
    duration = 1.0 / 60.0
    time = X / SIZE * duration
    x = X + amplitude * np.sin(2.0 * np.pi * frequency * time + phase) + bend * (X / SIZE) ** 2
    grating = Grating(16e-6, angle=np.radians(25.0), offset=3e-6)
    path = line_path(grating.height(x, 1.4 * Y), 16e-6 / np.cos(np.radians(25.0)), duration)
    assert path.shows_ripple
    found = path.strongest()
    assert found.frequency == pytest.approx(frequency, abs=6.0)
    assert found.amplitude == pytest.approx(amplitude, rel=0.1, abs=0.03e-6)
    assert path.at(frequency).amplitude == pytest.approx(amplitude, rel=0.1, abs=0.03e-6)


@pytest.mark.parametrize(("duration", "pixels"), [(2e-3, 200), (0.5, 200)])
def test_lines_too_short_or_too_coarse_show_no_ripple(duration: float, pixels: int) -> None:
    time = (np.arange(pixels) + 0.5) * duration / pixels
    assert not LinePath(time, np.zeros(pixels)).shows_ripple


def test_a_path_without_ripple_has_next_to_none() -> None:
    time = (np.arange(200) + 0.5) / 60.0 / 200
    still = LinePath(time, SIZE * time * 60.0).strongest()
    assert isinstance(still, Ripple)
    assert still.amplitude < 1e-12
