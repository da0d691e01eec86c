"""What is printed of a value does not contradict its interval."""

import pytest

from afm_scan_ros.core.diagnosis.result import Value
from afm_scan_ros.core.effects.registry import entry
from afm_scan_ros.report.value_words import value_words

(LAG,) = entry("rate_dependent_hysteresis").form("").parameters
"""From 0 to 1 s."""


@pytest.mark.parametrize(
    ("value", "half", "said"),
    [
        (0.05, 0.01, "50 ± 10 ms"),
        (
            1.0,
            0.1074,
            "1.000 (0.893 to 1.000) s, at the edge of what the catalogue allows: left open",
        ),
        (0.9, 0.2, "0.90 (0.70 to 1.00) s, up to the edge of what the catalogue allows"),
        (0.001, 0.002, "1.0 (0.0 to 3.0) ms, up to the edge of what the catalogue allows"),
        (1.0, float("inf"), "1 s, at the edge of what the catalogue allows: left open"),
    ],
)
def test_an_edge_is_said_at_the_number(value: float, half: float, said: str) -> None:
    assert value_words(Value(LAG, value, half)) == said
