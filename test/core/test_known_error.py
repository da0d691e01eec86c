"""The bands of a signal hold all of it, and nothing else."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.known_error import KnownError, band_edges, band_rms


@settings(deadline=None)
@given(
    samples=st.integers(2, 3000),
    sample_period=st.sampled_from([1e-2, 5e-5, 2e-5, 1 / 30_000]),
    seed=st.integers(0, 2**32 - 1),
)
def test_squares_of_the_bands_add_up_to_the_mean_square(
    samples: int, sample_period: float, seed: int
) -> None:
    signal = np.random.default_rng(seed).standard_normal(samples)
    bands = band_rms(signal, sample_period, band_edges(sample_period))
    assert np.sum(bands**2) == pytest.approx(np.mean(signal**2), rel=1e-9)


@given(frequency=st.sampled_from([2, 7, 70, 450, 2000]))
def test_a_sine_lies_in_its_band_alone(frequency: int) -> None:
    edges = band_edges(1e-4)
    signal = 3.0 * np.sin(2.0 * np.pi * frequency * 1e-4 * np.arange(10_000))
    bands = band_rms(signal, 1e-4, edges)
    inside = int(np.searchsorted(edges, frequency)) - 1
    assert bands[inside] == pytest.approx(3.0 / np.sqrt(2.0))
    assert np.delete(bands, inside) == pytest.approx(0.0, abs=1e-9)


def test_bands_end_at_the_nyquist_frequency() -> None:
    assert band_edges(1e-3) == (0.0, 1.0, 3.0, 10.0, 30.0, 100.0, 300.0, 420.0, 500.0)


@pytest.mark.parametrize(
    ("bands", "rms", "says"),
    [
        ((0.0, 1.0), (1e-9, 1e-9), "2 edges"),
        ((0.0,), (), "1 edges"),
        ((1.0, 0.5), (1e-9,), "ascend"),
        ((-1.0, 0.5), (1e-9,), "ascend"),
        ((0.0, 1.0), (-1e-9,), "no rms"),
        ((0.0, 1.0), (np.nan,), "no rms"),
        ((0.0, np.inf), (1e-9,), "no rms"),
    ],
)
def test_what_is_no_known_error_is_refused(
    bands: tuple[float, ...], rms: tuple[float, ...], says: str
) -> None:
    with pytest.raises(InputError, match=says):
        KnownError("record", bands, rms, rms, rms)
