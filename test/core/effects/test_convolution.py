"""Convolution by segments: the sum itself, whatever the lengths."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from afm_scan_ros.core.effects.optimal_inverse import (
    SAMPLES,
    Convolution,
    Kernel,
    OptimalInverse,
    OptimalInverses,
)


def same(found: np.ndarray, expected: np.ndarray) -> None:
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-11)


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
        same(found, np.convolve(signal, kernel, "valid"))


@settings(deadline=None, max_examples=40)
@given(
    taps=st.integers(1, 300),
    count=st.integers(1, 3),
    sizes=st.lists(
        st.one_of(st.integers(0, 400), st.integers(SAMPLES - 99, SAMPLES + 9)), max_size=3
    ),
    seed=st.integers(0, 2**32 - 1),
)
def test_parallel_streams_are_independent(
    taps: int, count: int, sizes: list[int], seed: int
) -> None:
    """However they are cut, one beside the other changes neither."""
    rng = np.random.default_rng(seed)
    kernels = rng.standard_normal((count, taps))
    streams = rng.standard_normal((count, sum(sizes) + taps))
    inverses = OptimalInverses([OptimalInverse(Kernel(kernel, 0), 0) for kernel in kernels])
    state, parts = inverses.at_rest()[:, :0], []
    for block in np.split(streams, np.cumsum(sizes), axis=1):
        state, part = inverses.invert(state, list(block))
        parts.append(part)
    for kernel, stream, found in zip(kernels, streams, np.hstack(parts), strict=True):
        same(found, Convolution(kernel).valid(stream))
