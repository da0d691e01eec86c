"""Figures measured in an image of a grating: what was put in comes out."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from afm_scan_bench.paper.grating import GratingFigures, grating_figures
from afm_scan_bench.paper.picture import Dust
from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.sample import Grating

SIZE = 40e-6
COLUMNS = SIZE * (np.arange(200) + 0.5) / 200
ROWS = np.linspace(0.0, SIZE, 128)
X, Y = np.meshgrid(COLUMNS, ROWS)

pitches = st.floats(8e-6, 14e-6)
angles = st.floats(-30.0, 30.0).map(np.radians)
offsets = st.floats(0.0, 16e-6)


def figures(sample: Grating | Dust, x: Array = X, y: Array = Y) -> GratingFigures:
    return grating_figures(sample.height(x, y), COLUMNS, ROWS)


@given(pitches, angles, offsets)
@settings(deadline=None, max_examples=40)
def test_a_straight_grating_is_found_as_it_is(pitch: float, angle: float, offset: float) -> None:
    found = figures(Grating(pitch, angle=angle, offset=offset))
    assert found.pitch == pytest.approx(pitch, rel=2e-3)
    assert found.pitch_spread < 0.02e-6
    assert found.bow < 0.1e-6
    assert found.shift is None or abs(found.shift) < 0.05e-6


@given(st.floats(0.8, 1.3), st.floats(0.0, 16e-6))
@settings(deadline=None, max_examples=25)
def test_a_wrong_gain_is_a_wrong_pitch(gain: float, offset: float) -> None:
    found = figures(Grating(10e-6, offset=offset), gain * X)
    assert found.pitch == pytest.approx(10e-6 / gain, rel=2e-3)


@given(st.floats(-4e-6, 4e-6), offsets)
@settings(deadline=None, max_examples=25)
def test_a_bend_is_a_bow(bend: float, offset: float) -> None:
    share = 2.0 * Y / SIZE - 1.0
    found = figures(Grating(12e-6, offset=offset), X + bend * share**2)
    assert found.bow == pytest.approx(abs(bend), rel=0.05, abs=0.05e-6)


@given(st.floats(-5e-6, 5e-6), st.floats(0.0, 16e-6))
@settings(deadline=None, max_examples=40)
def test_a_shift_that_ends_at_the_far_end_is_found(shift: float, offset: float) -> None:
    x = X.copy()
    x[1:] += shift * (1.0 - X[1:] / SIZE)
    found = figures(Grating(16e-6, offset=offset), x)
    if found.shift is not None:  # the edge nearest the near end may have left the image
        assert abs(found.shift) <= abs(shift) + 0.1e-6
        assert found.shift * shift >= -1e-13
        assert abs(found.shift) > 0.4 * abs(shift) - 0.1e-6


def test_bars_in_view_are_counted_and_dust_is_none() -> None:
    grating = Grating(10e-6, offset=5e-6)
    dust = Dust(15e-6, 20e-6, radius=1.5e-6, peak=80e-9, below=grating)
    assert figures(dust).bars_in_view == figures(grating).bars_in_view == 4
    assert figures(dust).pitch == pytest.approx(10e-6, rel=1e-3)


def test_glass_alone_has_no_figures() -> None:
    found = figures(Grating(500e-6, offset=250e-6))
    assert (found.bars_in_view, found.pitch, found.bow, found.shift) == (0, None, None, None)


def test_dust_lies_on_top() -> None:
    dust = Dust(0.0, 0.0, radius=2e-6, peak=50e-9, below=Grating())
    x, y = np.array([0.0, 1e-6, 2e-6]), np.zeros(3)
    assert dust.height(x, y) == pytest.approx([150e-9, 137.5e-9, 100e-9])
