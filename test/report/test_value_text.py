"""What is printed of a value does not contradict its interval."""

import pytest

from afm_scan_ros.core.diagnosis.result import Value
from afm_scan_ros.core.effects.registry import effect_type
from afm_scan_ros.report.quantity import value_text

(LAG,) = effect_type("rate_dependent_hysteresis").form("").parameters
"""From 0 to 1 s."""


@pytest.mark.parametrize(
    ("value", "half", "message"),
    [
        (0.05, 0.01, "50 ± 10 ms"),
        (
            1.0,
            0.1074,
            "1.000 (0.893 to 1.000) s, at the edge of the catalogue's range: not determined",
        ),
        (0.9, 0.2, "0.90 (0.70 to 1.00) s, up to the edge of the catalogue's range"),
        (0.001, 0.002, "1.0 (0.0 to 3.0) ms, up to the edge of the catalogue's range"),
        (1.0, float("inf"), "1 s, at the edge of the catalogue's range: not determined"),
    ],
)
def test_an_edge_is_said_at_the_number(value: float, half: float, message: str) -> None:
    assert value_text(Value(LAG, value, half)) == message
