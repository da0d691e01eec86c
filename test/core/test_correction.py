"""A correction follows any cut into blocks, and an operator's stop."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from afm_scan_ros.core.correction import Correction, Stop, window
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.trajectory import desired, phases, stopped, stopped_total, total_samples
from afm_scan_ros.core.types import Array, Trace

SPEC = ScanSpec(line_rate=20.0, lines=3, samples_per_line=200, preparation_cycles=2)
TOTAL = total_samples(SPEC)


def correction(seed: int) -> Correction:
    rng = np.random.default_rng(seed)
    share = window(SPEC)
    return Correction(SPEC, *(1e-7 * share * rng.standard_normal(TOTAL) for _ in range(2)))


def followed(of: Correction, path: Trace, cuts: list[int]) -> Array:
    stop: Stop = None
    parts = []
    count = len(path.x)
    for first, last in pairwise([0, *sorted({cut % count for cut in cuts} - {0}), count]):
        block = Trace(first, path.sample_period, path.x[first:last], path.y[first:last])
        stop, reference = of.follow(stop, block)
        parts.append(np.stack([reference.x, reference.y]))
    return np.concatenate(parts, axis=1)


@given(st.integers(0, 9), st.lists(st.integers(1, TOTAL), max_size=5))
def test_any_cut_gives_the_same_reference(seed: int, cuts: list[int]) -> None:
    path, found = desired(SPEC, 0, TOTAL), correction(seed)
    expected = np.stack([path.x + found.x, path.y + found.y])
    np.testing.assert_array_equal(followed(found, path, cuts), expected)


@given(st.integers(0, TOTAL - 1), st.lists(st.integers(1, TOTAL), max_size=3))
def test_a_stopped_scan_ends_where_it_would_without_it(stop: int, cuts: list[int]) -> None:
    total = stopped_total(SPEC, stop)
    path, found = stopped(SPEC, stop, 0, total), correction(1)
    reference = followed(found, path, cuts)
    np.testing.assert_array_equal(reference, followed(found, path, []))
    changes = np.abs(reference - np.stack([path.x, path.y]))
    assert changes[:, -1].max() < 1e-12  # a millionth of a correction of a micrometre
    largest = max(np.abs(found.x).max(), np.abs(found.y).max())
    assert changes.max() <= largest * (1.0 + 1e-9)


def test_the_whole_is_used_on_the_lines_and_nothing_at_rest() -> None:
    where, share = phases(SPEC), window(SPEC)
    assert (share[where.lines.start : where.lines.stop] == 1.0).all()
    assert not share[: where.approach.start].any()
    assert share[-1] == 0.0


@pytest.mark.parametrize("wrong", [np.zeros(TOTAL - 1), np.full(TOTAL, np.nan)])
def test_what_does_not_belong_to_the_scan_is_refused(wrong: Array) -> None:
    with pytest.raises(InputError, match=f"give {TOTAL} finite values"):
        Correction(SPEC, wrong, np.zeros(TOTAL))
