"""Whole lines, however the samples are cut."""

from itertools import pairwise

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from afm_scan_ros.core.streams import WholeLines


@given(
    lead=st.integers(0, 6),
    size=st.integers(1, 7),
    count=st.integers(1, 5),
    tail=st.integers(0, 6),
    inner=st.sets(st.integers(1, 40)),
)
def test_any_cut_gives_the_same_lines(
    lead: int, size: int, count: int, tail: int, inner: set[int]
) -> None:
    lines, total = range(lead, lead + count * size), lead + count * size + tail
    samples = np.arange(2.0 * total).reshape(2, total)
    whole, found = WholeLines(lines, size, 2), []
    for first, stop in pairwise([0, *sorted(each for each in inner if each < total), total]):
        for number, line in whole.add(first, samples[:, first:stop]):
            assert number == len(found)
            found.append(line.copy())
    assert np.array_equal(np.hstack(found), samples[:, lines.start : lines.stop])
