"""Each line's error, however the two streams are cut and interleaved."""

from itertools import pairwise
from random import Random

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from afm_scan_ros.core.streams import LineErrors
from afm_scan_ros.core.types import Trace

PERIOD = 1e-3
LINES, SIZE = range(7, 27), 5  # four lines of five samples after a lead of seven
TOTAL = 31
NAMES = ("desired_displacement", "achieved_displacement")

edges = st.sets(st.integers(1, TOTAL - 1)).map(lambda inner: [0, *sorted(inner), TOTAL])


@given(edges, edges, st.randoms(use_true_random=False), st.integers(0, 99))
@settings(deadline=None)
def test_lines_do_not_depend_on_blocks(
    first: list[int], second: list[int], order: Random, seed: int
) -> None:
    values = dict(zip(NAMES, np.random.default_rng(seed).normal(size=(2, 2, TOTAL)), strict=True))
    queue = {
        name: [
            Trace(a, PERIOD, values[name][0, a:b], values[name][1, a:b]) for a, b in pairwise(cut)
        ]
        for name, cut in zip(NAMES, (first, second), strict=True)
    }
    errors, found = LineErrors(LINES, SIZE), []
    while any(queue.values()):
        name = order.choice([n for n in NAMES if queue[n]])
        found += errors.add(name, queue[name].pop(0))
    error = (values[NAMES[1]] - values[NAMES[0]])[:, LINES.start : LINES.stop]
    whole = error.reshape(2, -1, SIZE)
    assert [line.line for line in found] == [0, 1, 2, 3]
    assert [line.first_sample for line in found] == list(LINES[::SIZE])
    rms = np.sqrt((whole**2).mean(axis=2))
    assert pytest.approx(rms, rel=1e-12) == np.array([[f.rms_x, f.rms_y] for f in found]).T
    largest = np.abs(whole).max(axis=2)
    assert pytest.approx(largest, rel=1e-12) == np.array([[f.max_x, f.max_y] for f in found]).T
