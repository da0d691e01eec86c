"""A fit that ran out of evaluations is no result."""

import numpy as np
import pytest
from scipy.optimize import least_squares

from afm_scan_ros.core.arguments import require_converged
from afm_scan_ros.core.errors import ScanError


def valley(at: np.ndarray) -> np.ndarray:
    """Rosenbrock's, whose minimum lies at (1, 1)."""
    return np.array([10.0 * (at[1] - at[0] ** 2), 1.0 - at[0]])


def test_a_minimum_is_passed_on() -> None:
    found = require_converged(least_squares(valley, [-1.2, 1.0]), "valley")
    assert found == pytest.approx([1.0, 1.0])


def test_a_fit_that_ran_out_of_evaluations_is_refused() -> None:
    with pytest.raises(ScanError, match=r"^valley: the fit has not converged after 3 evaluations"):
        require_converged(least_squares(valley, [-1.2, 1.0], max_nfev=3), "valley")
