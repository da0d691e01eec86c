"""A value is said to be measured only where the records, and not the catalogue's range, tell it."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from afm_scan_ros.core.diagnosis.result import Value
from afm_scan_ros.core.effects.registry import effect_type

(LAG,) = effect_type("rate_dependent_hysteresis").form("").parameters
"""From 0 to 1 s."""


@pytest.mark.parametrize(
    ("value", "half", "cut", "at_edge"),
    [
        (0.99999999995, 0.107, True, True),
        (0.9993, 0.0, False, True),
        (0.9986, 0.0, False, False),
        (0.993, 1.0, True, True),
        (0.986, 1.0, True, False),
        (0.9, 0.2, True, False),
        (0.5, 0.1, False, False),
        (0.0, 0.1, True, True),
        (1.0, math.inf, False, True),
        (0.5, math.inf, False, False),
    ],
)
def test_what_the_range_cuts_is_not_measured(
    value: float, half: float, *, cut: bool, at_edge: bool
) -> None:
    found = Value(LAG, value, half)
    assert (found.cut, found.at_edge) == (cut, at_edge)


@given(value=st.floats(0.0, 1.0), half=st.floats(1e-9, 10.0))
def test_the_interval_lies_within_the_range_and_about_the_value(value: float, half: float) -> None:
    found = Value(LAG, value, half)
    low, high = found.interval
    assert LAG.lower <= low <= value <= high <= LAG.upper
    if not found.cut:
        assert high - low == pytest.approx(2.0 * half, rel=1e-6)
