"""Extrapolation from line to line: exact for polynomials, calm in noise, stable with any delay."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from afm_scan_ros.core.types import Array
from afm_scan_ros.features.online.extrapolation import (
    DEGREES,
    LARGEST_GAIN_ERROR,
    LARGEST_SUM,
    NOISE_SHARE,
    Extrapolation,
    methods,
)

DELAYS = (1, 2, 3, 7, 20)
delays = pytest.mark.parametrize("delay", DELAYS)


def remaining(disturbance: Array, delay: int, gain: float = 1.0) -> Array:
    """Errors, (lines,), of a scanner that follows a correction with a gain."""
    law = Extrapolation(delay, 1)
    state, applied = law.at_rest(), np.zeros(len(disturbance) + delay)
    errors = np.empty(len(disturbance))
    for line, value in enumerate(disturbance):
        errors[line] = value - gain * applied[line]
        state, ahead = law.step(state, np.array([errors[line] + applied[line]]))
        applied[line + delay] = ahead[0]
    return errors


@delays
@given(
    coefficients=st.lists(st.floats(-1.0, 1.0), min_size=3, max_size=3), count=st.integers(1, 400)
)
@settings(deadline=None, max_examples=20)
def test_a_polynomial_is_extrapolated_exactly(
    delay: int, coefficients: list[float], count: int
) -> None:
    for method in methods(delay):
        if not method.usable(count):
            continue
        powers = np.arange(method.degree + 1)
        lines = (np.arange(count) / count)[:, None] ** powers
        ahead = ((count - 1 + delay) / count) ** powers
        own = np.array(coefficients[: method.degree + 1])
        found = method.extrapolated((lines @ own)[None])[0]
        assert found == pytest.approx(ahead @ own, abs=1e-6 * (1.0 + delay / count) ** 2)


@pytest.mark.parametrize("delay", [*range(1, 12), 20, 40, 60])
def test_weights_are_small_enough_for_any_number_of_lines(delay: int) -> None:
    found = methods(delay)
    assert {method.degree for method in found} >= {0, 1}
    for method in found:
        counts = {*range(1, method.memory + 2, 1 + method.memory // 40), method.memory}
        sums = [np.abs(method.weights(n)).sum() for n in counts if method.usable(n)]
        assert max(sums) <= LARGEST_SUM * (1.0 + 1e-6)
        assert method.usable(method.memory)


@given(
    delay=st.sampled_from(DELAYS),
    error=st.floats(-0.95 * LARGEST_GAIN_ERROR, 0.95 * LARGEST_GAIN_ERROR),
    seed=st.integers(0, 2**32 - 1),
)
@settings(deadline=None, max_examples=30)
def test_the_loop_is_bounded_with_any_gain_error_and_any_choice_of_methods(
    delay: int, error: float, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    disturbance = np.where(rng.random(300) < 0.5, -1.0, 1.0)
    left = np.max(np.abs(remaining(disturbance, delay, 1.0 + error)))
    correction = LARGEST_SUM / (1.0 - abs(error) * LARGEST_SUM)
    assert left <= 1.0 + (1.0 + abs(error)) * correction


@delays
def test_a_drift_of_constant_speed_leaves_no_lag(delay: int) -> None:
    late = remaining(np.arange(200.0), delay)[-20:]
    np.testing.assert_allclose(late, 0.0, atol=1e-6)


def test_a_drift_of_constant_acceleration_leaves_no_lag() -> None:
    late = remaining(1e-3 * np.arange(200.0) ** 2, delay=2)[-20:]
    np.testing.assert_allclose(late, 0.0, atol=1e-6)


@delays
def test_noise_is_fed_back_by_a_small_share_only(delay: int) -> None:
    noise = np.random.default_rng(7).standard_normal(2000)
    left = remaining(noise, delay)
    assert np.std(left) <= (1.0 + NOISE_SHARE) * np.std(noise)


@delays
def test_slower_than_the_bandwidth_is_reduced(delay: int) -> None:
    for method in methods(delay):
        lines = np.arange(4000.0)
        for factor, grows in ((0.8, False), (1.25, True)):
            swing = np.sin(2.0 * np.pi * factor * method.bandwidth * lines)
            ahead = np.convolve(swing, method.steady_weights)[: lines.size]
            left = (swing[delay:] - ahead[:-delay])[2000:]
            assert bool(np.std(left) > np.std(swing)) is grows


def test_what_is_constant_is_removed_and_nothing_stays_nothing() -> None:
    late = remaining(np.full(30, 5e-9), delay=3)
    np.testing.assert_allclose(late[6:], 0.0, atol=1e-20)
    assert not remaining(np.zeros(30), delay=3).any()


@delays
def test_each_degree_has_a_fast_and_a_calm_method(delay: int) -> None:
    for degree in DEGREES:
        decays = [method.decay for method in methods(delay) if method.degree == degree]
        assert decays == sorted(decays)
    calm = [m for m in methods(delay) if np.sum(m.steady_weights**2) <= (1 + NOISE_SHARE) ** 2 - 1]
    assert calm
