"""The criterion takes as many poles and zeros as the scanner has, and no more."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import signal

from afm_scan_ros.core.identification.vibration.line_response import FrequencyResponse
from afm_scan_ros.core.identification.vibration.rational_fit import Order
from afm_scan_ros.core.identification.vibration.structure import (
    OrderTrial,
    choose_order,
    fit_chosen,
)

Modes = list[tuple[list[float], list[float]]]
SAMPLE_PERIOD = 1e-4
LINES = np.arange(10.0, 800.0, 5.0)
SCATTER = 2e-3


def mode(frequency: float, damping: float, gain: float) -> tuple[list[float], list[float]]:
    omega = 2.0 * np.pi * frequency
    return [gain * omega**2], [1.0, 2.0 * damping * omega, omega**2]


def response(modes: Modes) -> NDArray[np.complex128]:
    total = np.zeros(len(LINES), dtype=np.complex128)
    for numerator, denominator in modes:
        b, a, _ = signal.cont2discrete((numerator, denominator), SAMPLE_PERIOD)
        total += signal.freqz(b[0], a, 2.0 * np.pi * LINES * SAMPLE_PERIOD)[1]
    return total


def measured(modes: Modes, seed: int = 1) -> FrequencyResponse:
    real, imaginary = np.random.default_rng(seed).standard_normal((2, len(LINES))) / np.sqrt(2.0)
    true = response(modes)
    deviation = SCATTER * np.abs(true)
    noisy = true + deviation * (real + 1j * imaginary)
    return FrequencyResponse(2.0 * np.pi * LINES, noisy, deviation, deviation, np.ones(len(LINES)))


FIRST, SECOND, THIRD = mode(300.0, 0.02, 1.0), mode(520.0, 0.05, 0.1), mode(700.0, 0.01, 0.05)


@pytest.mark.parametrize(
    ("modes", "chosen"),
    [([FIRST], Order(2, 0)), ([FIRST, SECOND], Order(4, 2)), ([FIRST, SECOND, THIRD], Order(6, 4))],
)
def test_order_of_the_scanner_is_chosen(modes: Modes, chosen: Order) -> None:
    found = choose_order(measured(modes), SAMPLE_PERIOD, 1.0)
    assert found.chosen == chosen
    assert found.best.explained


@pytest.mark.parametrize("frequency", [150.0, 300.0, 640.0])
@pytest.mark.parametrize("damping", [0.003, 0.02, 0.1])
def test_a_textbook_resonance_is_found_within_its_interval(
    frequency: float, damping: float
) -> None:
    fit = fit_chosen(measured([mode(frequency, damping, 1.0)], seed=3), SAMPLE_PERIOD, 1.0)
    assert fit.order == Order(2, 0)
    assert fit.resonance == pytest.approx(frequency, rel=1e-3)
    low, high = fit.resonance_interval
    assert low - (high - low) < frequency < high + (high - low)


def test_a_mode_beyond_the_band_is_not_taken() -> None:
    found = choose_order(measured([FIRST, SECOND, mode(1100.0, 0.01, 0.2)]), SAMPLE_PERIOD, 1.0)
    assert found.chosen.poles <= 5
    assert found.best.determined
    modes = np.exp(found.best.shape[:2]) * [800.0, 1.0]
    assert min(abs(modes[0] - each) for each in (300.0, 520.0)) < 20.0


def test_a_single_line_that_is_off_is_no_resonance() -> None:
    """Hum in step with the drive lies in one line."""
    seen = measured([FIRST])
    seen.response[8] *= 1.04
    fit = fit_chosen(seen, SAMPLE_PERIOD, 1.0)
    assert fit.resonance == pytest.approx(300.0, rel=1e-3)
    poles = np.roots(fit.model.denominator)
    resonant = np.abs(poles[-poles.real / np.abs(poles) < 0.2]) / (2.0 * np.pi)
    np.testing.assert_allclose(resonant, 300.0, rtol=0.01)


def test_what_no_model_explains_is_no_reason_for_a_larger_one() -> None:
    smaller, larger = (
        OrderTrial(Order(poles, 0), 100, squares, 0.1, determined=True, shape=np.zeros(poles))
        for poles, squares in ((2, 2100.0), (4, 2000.0))
    )
    dispersion = larger.chi_squared / larger.freedom
    assert smaller.criterion(1.0) > larger.criterion(1.0)
    assert smaller.criterion(dispersion) < larger.criterion(dispersion)
