"""The amplifier's limits and its ramp-down."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from afm_scan_ros.core.errors import ScanError
from afm_scan_ros.core.limits import AmplifierSpec, ramp_to_rest
from afm_scan_ros.core.types import Trace

SPEC = AmplifierSpec(voltage_limit=5.0, slew_limit=1e4, ramp_down_slew=40.0)
REST = {"x": 0.0, "y": 0.0}
PERIOD = 1e-4  # s: at most 1 V a sample


def drive(x: list[float], y: list[float]) -> Trace:
    return Trace(100, PERIOD, np.array(x), np.array(y))


@pytest.mark.parametrize(
    ("x", "y", "message"),
    [
        ([0.5, 1.0, 2.5], [0.0] * 3, r"sample 102, axis x: slope .* = 15000 is beyond .* 10000"),
        ([0.0] * 2, [-1.5, 0.0], r"sample 100, axis y: slope .* = -15000 "),
        ([0.0] * 2, [0.0, float("nan")], r"sample 101, axis y: drive \[V\] = nan "),
        ([0.0, float("inf")], [0.0] * 2, r"sample 101, axis x: drive \[V\] = inf is beyond .* 5:"),
    ],
)
def test_a_drive_beyond_a_limit_is_refused_with_its_place(
    x: list[float], y: list[float], message: str
) -> None:
    with pytest.raises(ScanError, match=message):
        SPEC.limits.refuse_beyond(drive(x, y), REST)


def test_the_limits_themselves_are_allowed_and_no_more() -> None:
    before = {"x": 4.5, "y": -5.0}
    SPEC.limits.refuse_beyond(drive([5.0, 4.5], [-5.0, -5.0]), before)
    with pytest.raises(ScanError, match=r"sample 101, axis x: drive \[V\] = 5.001 "):
        SPEC.limits.refuse_beyond(drive([5.0, 5.001], [-5.0, -5.0]), before)


@settings(deadline=None)
@given(st.floats(-5.0, 5.0), st.floats(-5.0, 5.0), st.floats(1e-5, 0.05))
def test_the_ramp_down_is_gentle_and_ends_at_rest(x: float, y: float, period: float) -> None:
    before = {"x": x, "y": y}
    ramp = ramp_to_rest(7, period, before, SPEC.ramp_down_slew)
    assert ramp.first_sample == 7
    for axis, start in before.items():
        path = np.append(start, ramp.axis(axis))
        assert path[-1] == 0.0
        assert np.all(np.diff(np.abs(path)) <= 0.0)
        assert np.max(np.abs(np.diff(path))) <= 1.001 * SPEC.ramp_down_slew * period


def test_the_tighter_of_two_limits_holds() -> None:
    assert SPEC.within(AmplifierSpec(6.0, 20.0, 20.0)) == AmplifierSpec(5.0, 20.0, 20.0)
    assert SPEC.within(AmplifierSpec(4.0, 1e5, 30.0)) == AmplifierSpec(4.0, 1e4, 30.0)
