"""An answer is cut where the blocks that asked for it end, and nothing of it is lost."""

from itertools import pairwise

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from afm_scan_ros.core.streams import MAX_BLOCK, cut_as, end
from afm_scan_ros.core.types import Trace

TOTAL = 2 * MAX_BLOCK + 7
SAMPLES = np.arange(float(TOTAL))
edges = st.sets(st.integers(1, TOTAL - 1), max_size=6).map(lambda s: [0, *sorted(s), TOTAL])


def trace(first: int, stop: int) -> Trace:
    return Trace(first, 1e-5, SAMPLES[first:stop], -SAMPLES[first:stop])


@given(edges, st.integers(0, TOTAL), st.integers(0, TOTAL))
def test_what_answers_blocks_is_cut_as_they_are(cuts: list[int], one: int, other: int) -> None:
    first, stop = sorted((one, other))
    blocks = [trace(a, b) for a, b in pairwise(cuts)]
    parts = list(cut_as(blocks, trace(first, stop)))
    assert all(0 < each.x.size <= MAX_BLOCK for each in parts)
    joined = np.concatenate([np.empty(0), *(each.x for each in parts)])
    np.testing.assert_array_equal(joined, SAMPLES[first:stop])
    assert {each for each in cuts if first < each < stop} <= {end(each) for each in parts}
