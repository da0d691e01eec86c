"""A number with its uncertainty and unit reads back as what it was."""

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from afm_scan_ros.report.quantity import PREFIXES, quantity

POWERS = {prefix: power for power, prefix in PREFIXES.items()}


@given(
    value=st.floats(-1e20, 1e20), half=st.floats(1e-20, 1e20), unit=st.sampled_from(["1/m2", "m"])
)
def test_an_uncertainty_has_two_digits(value: float, half: float, unit: str) -> None:
    message = quantity(value, half, unit)
    if "±" in message and 1e-12 < half < 1e6:
        digits = re.sub(r"\D", "", message.split("±")[1].split()[0].split(")")[0]).lstrip("0")
        assert len(digits.rstrip("0")) <= 2, message


@given(
    value=st.floats(1e-10, 1e7) | st.floats(-1e7, -1e-10),
    share=st.floats(1e-3, 1.0),
)
def test_value_and_interval_are_read_back(value: float, share: float) -> None:
    half = share * abs(value)
    message = re.fullmatch(r"(\S+) ± (\S+) ([pnµmkM]?)Hz", quantity(value, half, "Hz"))
    assert message is not None
    scale = 10.0 ** POWERS[message[3]]
    assert float(message[1]) * scale == pytest.approx(value, abs=0.05 * half)
    assert float(message[2]) * scale == pytest.approx(half, rel=0.06)


@pytest.mark.parametrize(
    ("value", "half", "unit", "message"),
    [
        (5.55e-5, 1.4e-5, "s", "56 ± 14 µs"),
        (0.0123, 0.0004, "1", "0.01230 ± 0.00040"),
        (-840.0, 12.0, "1/m", "-840 ± 12 1/m"),
        (2.0, float("inf"), "V", "2 V"),
        (0.0, 0.0, "m", "0 m"),
        (3334869.0, 2118695.0, "1/m2", "(3.3 ± 2.1)·10⁶ 1/m²"),
        (1.84e-10, 2.591e-9, "m", "0.2 ± 2.6 nm"),
        (4.7e-7, 3.14e-7, "m", "470 ± 310 nm"),
        (-2.5e14, float("inf"), "1/m4", "-250·10¹² 1/m⁴"),
    ],
)
def test_it_is_written_as_people_do(value: float, half: float, unit: str, message: str) -> None:
    assert quantity(value, half, unit) == message
