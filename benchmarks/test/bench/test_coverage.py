"""The bounds of a share have their stated coverage."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import binom

from afm_scan_bench.accuracy.coverage import clopper_pearson, with_bounds


@settings(deadline=None)
@given(of=st.integers(1, 300), data=st.data())
def test_at_its_bounds_a_count_is_just_as_rare_as_stated(of: int, data: st.DataObject) -> None:
    inside = data.draw(st.integers(0, of))
    low, high = clopper_pearson(inside, of)
    assert low <= inside / of <= high
    if inside > 0:
        assert binom.sf(inside - 1, of, low) == pytest.approx(0.025, rel=1e-6)
    if inside < of:
        assert binom.cdf(inside, of, high) == pytest.approx(0.025, rel=1e-6)


def test_bounds_of_a_row_that_always_holds() -> None:
    row = with_bounds({"parameter": "gain", "seeds": 200, "inside_percent": 100.0})
    assert row["parameter"] == "gain"
    assert row["lowest_percent"] == pytest.approx(100.0 * 0.025 ** (1.0 / 200.0))
    assert row["highest_percent"] == 100.0
