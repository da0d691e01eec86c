"""Convolution by segments: the sum itself, whatever the lengths."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from afm_scan_ros.core.effects.convolution import SAMPLES, Convolution, stream_together


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


@settings(deadline=None, max_examples=40)
@given(
    taps=st.lists(st.integers(1, 300), min_size=1, max_size=3),
    counts=st.lists(
        st.one_of(st.integers(0, 400), st.integers(SAMPLES - 99, SAMPLES + 9)), max_size=3
    ),
    seed=st.integers(0, 2**32 - 1),
)
def test_streams_side_by_side_are_each_its_own(
    taps: list[int], counts: list[int], seed: int
) -> None:
    """Whatever the lengths of kernels and blocks, one beside the other changes neither."""
    rng = np.random.default_rng(seed)
    kernels = [rng.standard_normal(n) for n in taps]
    streams = [rng.standard_normal(sum(counts) + len(taps) * n) for n in range(len(taps))]
    states, found = [np.empty(0) for _ in taps], [[np.empty(0)] for _ in taps]
    ends = [0, *np.cumsum(counts), None]
    for first, last in pairwise(ends):
        blocks = [stream[first:last] for stream in streams]
        states, results = stream_together([Convolution(k) for k in kernels], states, blocks)
        for all_of_one, result in zip(found, results, strict=True):
            all_of_one.append(result)
    for kernel, stream, parts in zip(kernels, streams, found, strict=True):
        assert np.concatenate(parts) == pytest.approx(Convolution(kernel).valid(stream), abs=1e-11)
