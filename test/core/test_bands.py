"""The bands of a signal hold all of it but its mean, and nothing else."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from afm_scan_ros.core.bands import rms_by_band
from afm_scan_ros.core.model import band_edges

PERIOD, COUNT = 1e-4, 10_000
RESONANCE = 450.0
EDGES = band_edges(PERIOD, RESONANCE)
TIME = PERIOD * (np.arange(COUNT) + 0.5)


@settings(deadline=None)
@given(
    samples=st.integers(2, 3000),
    sample_period=st.sampled_from([1e-2, 5e-5, 2e-5, 1 / 30_000]),
    seed=st.integers(0, 2**32 - 1),
)
def test_squares_of_the_bands_add_up_to_the_variance(
    samples: int, sample_period: float, seed: int
) -> None:
    signal = np.random.default_rng(seed).standard_normal(samples) + 3.0
    bands = rms_by_band(signal, band_edges(sample_period, RESONANCE), sample_period)
    assert np.sum(bands**2) == pytest.approx(np.var(signal), rel=1e-9)


@given(frequency=st.sampled_from([2, 7, 70, 450, 2000]))
def test_a_wave_lies_in_its_band_alone(frequency: int) -> None:
    bands = rms_by_band(3.0 * np.cos(2.0 * np.pi * frequency * TIME), EDGES, PERIOD)
    inside = int(np.searchsorted(EDGES, frequency)) - 1
    assert bands[inside] == pytest.approx(3.0 / np.sqrt(2.0))
    assert np.delete(bands, inside) == pytest.approx(0.0, abs=1e-9)


def test_a_record_that_ends_elsewhere_than_it_began_holds_no_jump() -> None:
    """A line from 0 to 1: of a jump back, one percent would lie above 300 Hz."""
    bands = rms_by_band(TIME / TIME[-1], EDGES, PERIOD)
    fast = np.array(EDGES[:-1]) >= 0.5 * RESONANCE
    assert np.linalg.norm(bands[fast]) < 1e-5
