"""Convolution by segments: the sum itself, whatever the lengths."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from afm_scan_ros.core.effects.convolution import SAMPLES, Convolution


@settings(deadline=None, max_examples=40)
@given(
    taps=st.integers(1, 300),
    count=st.one_of(st.integers(0, 400), st.integers(5 * SAMPLES - 9, 5 * SAMPLES + 9)),
    seed=st.integers(0, 2**32 - 1),
)
def test_the_filter_is_the_sum(taps: int, count: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    kernel, signal = rng.standard_normal(taps), rng.standard_normal(count)
    found = Convolution(kernel).valid(signal)
    assert found.shape == (max(count - taps + 1, 0),)
    if len(found):
        assert found == pytest.approx(np.convolve(signal, kernel, "valid"), abs=1e-11)
