"""A known transfer function is recovered from its response behind a hold."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import signal

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.vibration.line_response import FrequencyResponse
from afm_scan_ros.core.identification.vibration.rational_fit import (
    Band,
    Order,
    RationalFit,
    fit_rational,
)
from afm_scan_ros.core.types import Array

NUMERATOR = np.array([0.435, 3910.0, 1.21e7, 1.07e14])
DENOMINATOR = np.array([1.0, 8980.0, 2.78e7, 7.38e10, 1.55e14])  # Eq. 5
RESONANCE, DAMPING = 453.936, 0.012026  # of Eq. 5's least damped root
PERIOD = 2e-5
OMEGA = 2.0 * np.pi * np.arange(4.0, 1000.0, 2.0)
GAUGE = 5e-6


def measured(
    response: NDArray[np.complex128], scatter: float = 0.0, highest: float = 800.0
) -> FrequencyResponse:
    deviation = scatter * np.abs(response)
    found = FrequencyResponse(OMEGA, response, deviation, deviation, np.ones(len(OMEGA)))
    return found.up_to(highest)


def held(numerator: Array, denominator: Array) -> NDArray[np.complex128]:
    """Return scipy's zero-order hold, in time scaled so that its matrices are well conditioned."""
    scale = 1e3 ** np.arange(len(denominator))[::-1]
    space = signal.tf2ss(numerator * scale[-len(numerator) :], denominator * scale)
    a, b, c, *_ = signal.cont2discrete(space, 1e3 * PERIOD)
    shifts = np.exp(1j * OMEGA * PERIOD)
    return np.array([(c @ np.linalg.solve(z * np.eye(len(a)) - a, b)).item() for z in shifts])


def test_equation_5_is_recovered_and_set_to_the_gauge() -> None:
    fit = fit_rational(measured(3e-6 * held(NUMERATOR, DENOMINATOR)), PERIOD, GAUGE)
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


@pytest.mark.parametrize("order", [Order(2, 0), Order(4, 3), Order(5, 2)])
def test_slopes_of_the_search_give_the_gradient(order: Order) -> None:
    band = Band.of(measured(3e-6 * held(NUMERATOR, DENOMINATOR)), PERIOD, GAUGE, order)
    shape = np.log(np.resize([0.6, 0.1, 1.3, 0.4, 0.2], order.poles))
    found = 2.0 * band.projected(shape) @ band.projected_slopes(shape)
    true = [
        np.diff([np.sum(band.projected(shape + way * step) ** 2) for way in (-1.0, 1.0)]).item()
        for step in 5e-6 * np.eye(order.poles)
    ]
    np.testing.assert_allclose(found, np.array(true) / 1e-5, rtol=1e-5)


def test_mode_beyond_the_band_does_not_move_the_resonance() -> None:
    omega, damping = 2.0 * np.pi * 1400.0, 0.004
    mode = np.array([1.0, 2.0 * damping * omega, omega**2])
    both = np.polyadd(np.polymul(NUMERATOR, mode), 0.01 * omega**2 * DENOMINATOR)
    fit = fit_rational(measured(held(both, np.polymul(DENOMINATOR, mode))), PERIOD, GAUGE)
    assert fit.resonance == pytest.approx(RESONANCE, rel=2e-4)
    assert fit.damping == pytest.approx(DAMPING, rel=1e-2)
    assert 1e-5 < fit.misfit < 1e-2


@pytest.mark.parametrize("seed", range(3))
def test_model_of_a_noisy_response_is_stable(seed: int) -> None:
    real, imaginary = np.random.default_rng(seed).standard_normal((2, len(OMEGA)))
    noisy = held(NUMERATOR, DENOMINATOR) * (1.0 + 0.05 * (real + 1j * imaginary))
    fit = fit_rational(measured(noisy, 0.05), PERIOD, GAUGE)
    assert np.roots(fit.model.denominator).real.max() < 0.0
    assert fit.resonance == pytest.approx(RESONANCE, rel=1e-2)


def test_too_few_lines_are_refused() -> None:
    with pytest.raises(InputError, match="4 excited lines up to 10 Hz"):
        fit_rational(measured(held(NUMERATOR, DENOMINATOR), highest=11.0), PERIOD, GAUGE)


SECOND = np.array([1.0, 2.0 * 0.01 * 4000.0, 4000.0**2])
"""A further mode within the band, at 637 Hz."""


def test_more_poles_find_more_modes() -> None:
    denominator = np.polymul(DENOMINATOR, SECOND)
    numerator = np.polyadd(np.polymul(NUMERATOR, SECOND), 0.02 * SECOND[-1] * DENOMINATOR)
    response = measured(held(numerator, denominator), highest=1000.0)
    fit = fit_rational(response, PERIOD, GAUGE, Order(6, 5))
    assert fit.order == Order(6, 5)
    assert fit.misfit < 1e-6
    np.testing.assert_allclose(fit.model.denominator, denominator, rtol=1e-4)
    assert fit.resonance == pytest.approx(RESONANCE, rel=1e-5)


@pytest.mark.parametrize("order", [Order(1, 0), Order(2, 0), Order(3, 1), Order(5, 4)])
def test_any_order_gives_a_stable_model_of_that_order(order: Order) -> None:
    fit = fit_rational(measured(held(NUMERATOR, DENOMINATOR)), PERIOD, GAUGE, order)
    assert fit.order == order
    assert np.roots(fit.model.denominator).real.max() < 0.0
    assert fit.model.static_gain == pytest.approx(GAUGE, rel=1e-9)


def test_as_many_zeros_as_poles_are_refused() -> None:
    with pytest.raises(InputError, match="give fewer zeros than poles"):
        Order(4, 4)


def noisy_fit(scatter: float, seed: int) -> RationalFit:
    real, imaginary = np.random.default_rng(seed).standard_normal((2, len(OMEGA)))
    noise = scatter / np.sqrt(2.0) * (real + 1j * imaginary)
    response = held(NUMERATOR, DENOMINATOR) * (1.0 + noise)
    return fit_rational(measured(response, scatter), PERIOD, GAUGE)


def test_intervals_hold_the_truth() -> None:
    gain = NUMERATOR[-1] / DENOMINATOR[-1] / GAUGE
    fits = [noisy_fit(0.01, seed) for seed in range(20)]
    for true, intervals in (
        (RESONANCE, [fit.resonance_interval for fit in fits]),
        (DAMPING, [fit.damping_interval for fit in fits]),
        (gain, [fit.gain_interval for fit in fits]),
    ):
        low, high = np.array(intervals).T
        assert np.mean((low < true) & (true < high)) >= 0.85


def test_intervals_narrow_with_the_scatter() -> None:
    wide, narrow = (np.ptp(noisy_fit(scatter, 0).resonance_interval) for scatter in (0.04, 0.01))
    assert wide / narrow == pytest.approx(4.0, rel=0.2)
