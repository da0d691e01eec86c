"""Laws of least squares under differences that may not fall."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy import sparse
from scipy.optimize import lsq_linear

from afm_scan_ros.core.identification.hysteresis.everett_equations import (
    ENOUGH,
    solved,
    solved_rising,
)
from afm_scan_ros.core.types import Array

SIZE, LEAST = 12, 1e-6
VALUES = arrays(np.float64, SIZE, elements=st.floats(-3.0, 3.0))
WEIGHTS = arrays(np.float64, SIZE, elements=st.floats(0.1, 10.0))
STEPS = sparse.csr_matrix(np.diff(np.eye(SIZE), axis=0))


@given(values=VALUES, weights=WEIGHTS)
@settings(deadline=None)
def test_no_rising_solution_fits_better(values: Array, weights: Array) -> None:
    """As steps from 0 on, the same least squares has bounds that another solver knows."""
    found = solved_rising(sparse.diags(weights, format="csc"), values, STEPS, LEAST)
    assert np.diff(found).min() >= ENOUGH * LEAST
    steps = np.sqrt(weights)[:, np.newaxis] * np.tri(SIZE)
    lowest = np.append(-np.inf, np.full(SIZE - 1, LEAST))
    best = lsq_linear(steps, np.sqrt(weights) * values, (lowest, np.inf), method="bvls")
    np.testing.assert_allclose(found, np.cumsum(best.x), atol=SIZE * LEAST)


@given(values=VALUES)
@settings(deadline=None)
def test_what_rises_stays(values: Array) -> None:
    rising = np.sort(values) + LEAST * np.arange(SIZE)
    normal = sparse.identity(SIZE, format="csc")
    np.testing.assert_array_equal(solved_rising(normal, rising, STEPS, LEAST), rising)


def test_equations_are_solved() -> None:
    normal = (STEPS.T @ STEPS + sparse.identity(SIZE)).tocsc()
    wanted = np.arange(SIZE, dtype=np.float64) ** 2
    np.testing.assert_allclose(solved(normal, normal @ wanted), wanted, rtol=1e-12, atol=1e-12)
