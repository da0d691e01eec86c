"""A known transfer function is recovered from its response behind a hold."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import signal

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.frequency_response import FrequencyResponse
from afm_scan_ros.core.identification.rational_fit import fit_rational
from afm_scan_ros.core.types import Array

NUMERATOR = np.array([0.435, 3910.0, 1.21e7, 1.07e14])
DENOMINATOR = np.array([1.0, 8980.0, 2.78e7, 7.38e10, 1.55e14])  # Eq. 5
RESONANCE, DAMPING = 453.936, 0.012026  # of Eq. 5's least damped root
PERIOD = 2e-5
OMEGA = 2.0 * np.pi * np.arange(4.0, 1000.0, 2.0)
GAUGE = 5e-6


def measured(response: NDArray[np.complex128], scatter: float = 0.0) -> FrequencyResponse:
    deviation = scatter * np.abs(response)
    return FrequencyResponse(OMEGA, response, deviation, deviation, np.ones(len(OMEGA)))


def held(numerator: Array, denominator: Array) -> NDArray[np.complex128]:
    """Return scipy's zero-order hold, in time scaled so that its matrices are well conditioned."""
    scale = 1e3 ** np.arange(len(denominator))[::-1]
    space = signal.tf2ss(numerator * scale[-len(numerator) :], denominator * scale)
    a, b, c, *_ = signal.cont2discrete(space, 1e3 * PERIOD)
    shifts = np.exp(1j * OMEGA * PERIOD)
    return np.array([(c @ np.linalg.solve(z * np.eye(len(a)) - a, b)).item() for z in shifts])


def test_equation_5_is_recovered_and_set_to_the_gauge() -> None:
    fit = fit_rational(measured(3e-6 * held(NUMERATOR, DENOMINATOR)), PERIOD, GAUGE, 800.0)
    factor = GAUGE * DENOMINATOR[-1] / NUMERATOR[-1]
    np.testing.assert_allclose(fit.model.denominator, DENOMINATOR, rtol=1e-6)
    np.testing.assert_allclose(
        np.polyval(fit.model.numerator, 1j * OMEGA),
        factor * np.polyval(NUMERATOR, 1j * OMEGA),
        rtol=1e-6,
    )
    assert fit.gain_ratio == pytest.approx(3e-6 / factor, rel=1e-9)
    assert fit.resonance == pytest.approx(RESONANCE, rel=1e-5)
    assert fit.damping == pytest.approx(DAMPING, rel=1e-4)


def test_mode_beyond_the_band_does_not_move_the_resonance() -> None:
    omega, damping = 2.0 * np.pi * 1400.0, 0.004
    mode = np.array([1.0, 2.0 * damping * omega, omega**2])
    both = np.polyadd(np.polymul(NUMERATOR, mode), 0.01 * omega**2 * DENOMINATOR)
    fit = fit_rational(measured(held(both, np.polymul(DENOMINATOR, mode))), PERIOD, GAUGE, 800.0)
    assert fit.resonance == pytest.approx(RESONANCE, rel=2e-4)
    assert fit.damping == pytest.approx(DAMPING, rel=1e-2)
    assert 1e-5 < fit.misfit < 1e-2


@pytest.mark.parametrize("seed", range(3))
def test_model_of_a_noisy_response_is_stable(seed: int) -> None:
    real, imaginary = np.random.default_rng(seed).standard_normal((2, len(OMEGA)))
    noisy = held(NUMERATOR, DENOMINATOR) * (1.0 + 0.05 * (real + 1j * imaginary))
    fit = fit_rational(measured(noisy, 0.05), PERIOD, GAUGE, 800.0)
    assert np.roots(fit.model.denominator).real.max() < 0.0
    assert fit.resonance == pytest.approx(RESONANCE, rel=1e-2)


def test_too_few_lines_are_refused() -> None:
    with pytest.raises(InputError, match="4 excited lines up to 11 Hz"):
        fit_rational(measured(held(NUMERATOR, DENOMINATOR)), PERIOD, GAUGE, 11.0)
