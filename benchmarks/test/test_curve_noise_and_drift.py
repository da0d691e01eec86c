"""Noise and drift of reversal curves, against what was put in."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from afm_scan_bench.measured.curve_noise import curve_noise
from afm_scan_bench.measured.drift_points import freed_of_drift
from afm_scan_bench.measured.reversal_curve import ReversalCurve


@settings(max_examples=20, deadline=None)
@given(sigma=st.floats(1e-4, 10.0), seed=st.integers(0, 100))
def test_noise_is_found_on_uneven_curves_that_bend_in_places(sigma: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    inputs = np.sort(rng.uniform(-3.0, 3.0, (20, 400)), axis=1)
    clean = 0.5 * sigma * inputs + 20.0 * sigma * np.tanh(20.0 * inputs)
    outputs = clean + sigma * rng.standard_normal(inputs.shape)
    curves = [ReversalCurve(*pair) for pair in zip(inputs, outputs, strict=True)]
    assert curve_noise(curves) == pytest.approx(sigma, rel=0.06)


def test_straight_curves_have_no_noise() -> None:
    inputs = np.cumsum(np.random.default_rng(1).uniform(0.1, 1.0, 50))
    assert curve_noise([ReversalCurve(inputs, 2.0 * inputs - 1.0)]) < 1e-12


def test_steady_drift_is_taken_off_and_the_first_curve_stays() -> None:
    drift = 0.3 * np.arange(40)
    curves = [ReversalCurve(np.arange(5.0), np.arange(5.0) + shift) for shift in drift]
    freed = freed_of_drift(curves, 10.0 + drift)
    for curve in freed:
        np.testing.assert_allclose(curve.outputs, np.arange(5.0), atol=1e-12)


def test_noise_of_the_drift_points_hardly_reaches_the_curves() -> None:
    rng = np.random.default_rng(2)
    curves = [ReversalCurve(np.arange(5.0), np.arange(5.0)) for _ in range(200)]
    freed = freed_of_drift(curves, rng.standard_normal(200))
    shifts = np.array([curve.outputs[0] for curve in freed])[5:-5]
    assert shifts.std() < 0.4
