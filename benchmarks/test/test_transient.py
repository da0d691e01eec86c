"""A transient is told from what is periodic, whatever drifts."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from afm_scan_bench.measured.micromanipulator.transient import end_of_transient
from afm_scan_ros.core.errors import InputError

PERIOD, COUNT = 50, 12


@given(st.integers(0, 5), st.floats(-0.01, 0.01), st.integers(0, 2**32 - 1))
@settings(deadline=None)
def test_the_period_after_the_transient_is_found(disturbed: int, drift: float, seed: int) -> None:
    time = np.arange(PERIOD * COUNT)
    noise = np.random.default_rng(seed).normal(0.0, 0.01, len(time))
    record = np.sin(2.0 * np.pi * time / PERIOD) + drift * time / PERIOD + noise
    sizes = 0.3 * (1.0 + np.arange(disturbed) % 2)  # no two neighbours alike
    record[: disturbed * PERIOD] += np.outer(sizes, np.linspace(-1.0, 1.0, PERIOD)).ravel()
    assert end_of_transient(record, PERIOD) == disturbed * PERIOD


def test_too_few_periods_are_refused() -> None:
    with pytest.raises(InputError, match="holds 3 periods of 50"):
        end_of_transient(np.zeros(3 * PERIOD + PERIOD // 2), PERIOD)
