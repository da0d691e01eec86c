"""The criterion takes as many poles as the scanner has, and no more."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import signal

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.vibration.order_selection import OrderTrial, choose_order
from afm_scan_ros.core.identification.vibration.rational_fit import Order
from afm_scan_ros.core.identification.vibration.spectra import RecordSpectra

SAMPLE_PERIOD = 1e-4
LINES = np.arange(10.0, 800.0, 10.0)
ORDERS = (Order(2, 1), Order(4, 3), Order(6, 5))


def mode(frequency: float, damping: float, gain: float) -> tuple[list[float], list[float]]:
    omega = 2.0 * np.pi * frequency
    return [gain * omega**2], [1.0, 2.0 * damping * omega, omega**2]


def response(modes: list[tuple[list[float], list[float]]]) -> NDArray[np.complex128]:
    total = np.zeros(len(LINES), dtype=np.complex128)
    for numerator, denominator in modes:
        b, a, _ = signal.cont2discrete((numerator, denominator), SAMPLE_PERIOD)
        total += signal.freqz(b[0], a, 2.0 * np.pi * LINES * SAMPLE_PERIOD)[1]
    return total


def waves(modes: list[tuple[list[float], list[float]]], count: int = 5) -> RecordSpectra:
    rng = np.random.default_rng(1)
    shape = (count, len(LINES), 1)
    inputs = np.exp(2j * np.pi * rng.random(shape))
    true = response(modes)[:, np.newaxis]
    noise = 1e-3 * (rng.standard_normal(shape) + 1j * rng.standard_normal(shape)) / np.sqrt(2.0)
    variance = np.broadcast_to(1e-6 * np.abs(true) ** 2, shape)
    outputs = true * (inputs + noise)
    return RecordSpectra(2.0 * np.pi * LINES, inputs, outputs, variance, np.full(count, 4.0))


@pytest.mark.parametrize(
    ("modes", "chosen"),
    [
        ([mode(300.0, 0.02, 1.0)], Order(2, 1)),
        ([mode(300.0, 0.02, 1.0), mode(520.0, 0.05, 0.1)], Order(4, 3)),
        ([mode(300.0, 0.02, 1.0), mode(520.0, 0.05, 0.1), mode(700.0, 0.01, 0.05)], Order(6, 5)),
    ],
)
def test_order_of_the_scanner_is_chosen(
    modes: list[tuple[list[float], list[float]]], chosen: Order
) -> None:
    found = choose_order(waves(modes), SAMPLE_PERIOD, 1.0, 800.0, ORDERS)
    assert found.chosen == chosen
    assert [trial.order for trial in found.trials] == list(ORDERS)
    error = next(trial.error for trial in found.trials if trial.order == chosen)
    assert error == pytest.approx(1e-3, rel=0.2)


def test_a_mode_beyond_the_band_predicts_better_and_is_not_taken() -> None:
    modes = [mode(300.0, 0.02, 1.0), mode(520.0, 0.05, 0.1), mode(1100.0, 0.01, 0.2)]
    found = choose_order(waves(modes), SAMPLE_PERIOD, 1.0, 800.0, ORDERS)
    _, smaller, larger = found.trials
    assert larger.beats(smaller)
    assert not larger.told
    assert found.chosen == Order(4, 3)


def test_gain_that_differs_as_much_from_wave_to_wave_is_no_reason() -> None:
    smaller = OrderTrial(Order(4, 3), (1.0, 1.1, 0.9, 1.0))
    luckier = OrderTrial(Order(6, 5), (0.9, 1.2, 0.8, 1.05))
    better = OrderTrial(Order(6, 5), (0.9, 1.0, 0.8, 0.9))
    assert not luckier.beats(smaller)
    assert better.beats(smaller)


def test_two_waves_are_too_few() -> None:
    with pytest.raises(InputError, match="drive at least 3 draws"):
        choose_order(waves([mode(300.0, 0.02, 1.0)], count=2), SAMPLE_PERIOD, 1.0, 800.0)
