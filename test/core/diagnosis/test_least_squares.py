"""A nonlinear fit within bounds finds what SciPy's finds."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import least_squares, lsq_linear

from afm_scan_ros.core.diagnosis.least_squares import minimised
from afm_scan_ros.core.diagnosis.settings import DescentSettings
from afm_scan_ros.core.errors import ScanError
from afm_scan_ros.core.types import Array

EXACT = DescentSettings(rounds=200, tolerance=1e-9)


@given(seed=st.integers(0, 2**32 - 1), count=st.integers(1, 6), widest=st.floats(0.01, 10.0))
def test_a_linear_residual_is_fitted_within_its_bounds(
    seed: int, count: int, widest: float
) -> None:
    rng = np.random.default_rng(seed)
    slope, aim = rng.standard_normal((20, count)), rng.standard_normal(20)
    ends = -widest * rng.uniform(size=count), widest * rng.uniform(size=count)
    start = rng.uniform(*ends)
    found, _ = minimised(lambda x: slope @ x - aim, lambda _: slope, start, ends, EXACT)
    best = lsq_linear(slope, aim, ends, tol=1e-12)
    assert np.all((ends[0] <= found) & (found <= ends[1]))
    assert 0.5 * np.sum((slope @ found - aim) ** 2) <= best.cost + 1e-6 * max(best.cost, 1.0)


@given(rate=st.floats(0.5, 5.0), size=st.floats(0.1, 10.0))
def test_a_decay_is_fitted_as_well_as_by_scipy(rate: float, size: float) -> None:
    time = np.linspace(0.0, 2.0, 50)
    seen = size * np.exp(-rate * time) + 0.01 * np.cos(40.0 * time)
    ends = np.array([0.0, 0.1]), np.array([5.0, 20.0])

    def residual(x: Array) -> Array:
        return np.asarray(x[0] * np.exp(-x[1] * time) - seen)

    def jacobian(x: Array) -> Array:
        wave = np.exp(-x[1] * time)
        return np.column_stack((wave, -x[0] * time * wave))

    begun = np.array([1.0, 1.0])
    found, slope = minimised(residual, jacobian, begun, ends, EXACT)
    best = least_squares(residual, begun, jacobian, ends, x_scale="jac", max_nfev=2000)
    assert 0.5 * np.sum(residual(found) ** 2) <= best.cost * (1.0 + 1e-3) + 1e-7
    np.testing.assert_array_equal(slope, jacobian(found))


@pytest.mark.parametrize("blind", [0, 1])
def test_a_parameter_without_influence_stays(blind: int) -> None:
    slope = np.eye(3, 2)
    slope[:, blind] = 0.0
    ends = np.full(2, -9.0), np.full(2, 9.0)
    begun = np.full(2, 0.5)
    found, _ = minimised(lambda x: slope @ x - 1.0, lambda _: slope, begun, ends, EXACT)
    assert found[blind] == 0.5
    assert found[1 - blind] == pytest.approx(1.0, abs=1e-4)


def test_a_response_without_bound_is_refused() -> None:
    ends = np.zeros(1), np.ones(1)
    with pytest.raises(ScanError, match="without bound"):
        minimised(lambda x: x - 1.0, lambda _: np.full((1, 1), np.nan), ends[0], ends, EXACT)
