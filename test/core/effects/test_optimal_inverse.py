"""The optimal inverse: exact as R → 0, stream equal to whole, hold inverted, walls refused."""

from functools import cache
from itertools import pairwise

import numpy as np
import paper
import pytest

from afm_scan_ros.core.effects.optimal_inverse import (
    OptimalInverse,
    RelativeWeight,
    SmoothWeight,
    optimal_kernel,
)
from afm_scan_ros.core.effects.vibration import Vibration
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import Array

MODEL = paper.vibration()
WEIGHT = RelativeWeight().at(MODEL.natural_frequency)
RANGE = 40e-6


@cache
def raster(rate: float, line_rate: float = 250.0, turnaround: float = 0.3) -> np.ndarray:
    """A line of rest and ten to-and-fro lines of 40 µm from rest to rest, with sin² turn-arounds.

    The rest at first is where the inverse acts ahead of the first motion.
    """
    n = round(rate / line_rate)
    from_corner = np.abs((np.arange(n) / n + 0.25) % 0.5 - 0.25)
    pulse = np.cos(np.pi * np.minimum(from_corner / turnaround, 0.5) * 2.0) ** 2
    pulse[from_corner > turnaround / 4.0] = 0.0
    speed = np.cumsum(pulse * np.where((np.arange(n) / n + 0.25) % 1.0 < 0.5, 1.0, -1.0))
    line = np.cumsum(speed - speed.mean())
    line -= 0.5 * (line.max() + line.min())
    rise = np.clip(np.arange(10 * n) / (3 * n), 0.0, 1.0)
    rise = rise**3 * (10.0 - 15.0 * rise + 6.0 * rise**2)
    lines = np.tile(line, 10) * RANGE / np.ptp(line) * rise * rise[::-1]
    return np.concatenate((np.zeros(n), lines))


def error(effect: Vibration, targets: np.ndarray) -> float:
    """Rms error of the four middle lines, in shares of the range."""
    _, response = effect.apply(effect.at_rest(), effect.inverse.invert_whole(targets))
    middle = slice(4 * len(targets) // 11, 8 * len(targets) // 11)
    return float(np.sqrt(np.mean((response - targets)[middle] ** 2))) / RANGE


def test_the_inverse_tends_to_the_exact_one_as_its_cost_vanishes() -> None:
    targets = raster(20e3)
    errors = [
        error(Vibration(MODEL, 5e-5, SmoothWeight(corner, 2)), targets)
        for corner in (3e3, 1e4, 3e4, 1e5, 1e7)
    ]
    assert all(b < 0.5 * a for a, b in pairwise(errors))
    assert errors[-1] <= 1e-6


def test_the_default_cost_keeps_a_250_hz_raster_in_range_and_exact() -> None:
    effect = Vibration(MODEL, 1e-5)
    inputs = effect.inverse.invert_whole(raster(100e3))
    assert -5.9 < inputs.min() < inputs.max() < 5.1
    assert error(effect, raster(100e3)) < 0.01


@pytest.mark.parametrize("rate", [20e3, 100e3])
def test_stream_equals_whole_within_a_millionth(rate: float) -> None:
    effect, targets = Vibration(MODEL, 1.0 / rate), raster(rate)
    state, first = effect.invert(effect.inverse_at_rest(), targets)
    stream = np.concatenate((first, effect.finish(state)))
    whole = effect.inverse.invert_whole(targets)
    assert effect.inverse.preview <= 20e-3 * rate
    assert np.abs(stream - whole).max() <= 1e-6 * np.ptp(whole)


def test_the_error_falls_with_the_preview_and_too_short_a_one_shows() -> None:
    kernel, targets = Vibration(MODEL, 5e-5).inverse.kernel, raster(20e3)
    whole, errors = OptimalInverse(kernel, len(kernel.values)).invert_whole(targets), []
    for preview in (40, 80, 160, 240):  # 2, 4, 8, 12 ms
        stream = OptimalInverse(kernel, preview)
        state, first = stream.invert(stream.at_rest(), targets)
        found = np.concatenate((first, stream.finish(state)))
        errors.append(np.abs(found - whole).max() / np.ptp(whole))
    assert errors[0] > 1e-2
    assert (np.diff(np.log10(errors)) < -0.5).all()
    assert errors[-1] <= 1e-6


def test_the_whole_is_equation_22_on_the_whole_trajectory() -> None:
    """Against one long Fourier transform of the trajectory, which begins and ends at rest."""
    period, targets = 5e-5, raster(20e3)
    effect = Vibration(MODEL, period)
    size = 2**15
    omega = np.linspace(0.0, np.pi / period, size // 2 + 1)
    _, impulse = effect.apply(effect.at_rest(), np.eye(1, size)[0])
    gain = np.fft.rfft(impulse)
    cost = WEIGHT.ratio(omega, period) * np.abs(gain[0]) ** 2
    modified = np.fft.rfft(targets, size) * gain.conj() / (np.abs(gain) ** 2 + cost)
    expected = np.fft.irfft(modified, size)[: len(targets)]
    whole = effect.inverse.invert_whole(targets)
    assert np.abs(whole - expected).max() <= 1e-8 * np.ptp(expected)


def test_a_scanner_at_rest_is_placed_exactly() -> None:
    inputs = Vibration(MODEL, 5e-5).inverse.invert_whole(np.full(4000, 1e-5))
    assert inputs[-1] == pytest.approx(1e-5 / MODEL.static_gain, rel=1e-9)


def test_leaving_the_hold_out_is_half_a_sample_period_late() -> None:
    """At 250 Hz that is 1.1° at 20 kHz, a fifth of it at 100 kHz."""
    lag = {}
    for rate in (20e3, 100e3):
        effect, targets = Vibration(MODEL, 1.0 / rate), raster(rate)
        gone = OptimalInverse(optimal_kernel(MODEL.response, WEIGHT, 1.0 / rate), 0)
        late = effect.inverse.invert_whole(targets) - gone.invert_whole(targets)
        _, lag[rate] = effect.apply(effect.at_rest(), late)
        half_period_of_motion = 0.5 * np.gradient(targets)
        assert lag[rate] == pytest.approx(half_period_of_motion, abs=5e-3 * RANGE)
    assert np.ptp(lag[20e3]) == pytest.approx(5.0 * np.ptp(lag[100e3]), rel=0.02)


def test_a_weight_with_a_step_is_refused_with_its_tail() -> None:
    class BrickWall:
        def ratio(self, omega: Array, sample_period: float) -> Array:  # noqa: ARG002 - Weight's
            return np.where(omega <= 2.0 * np.pi * 2000.0, 0.0, np.inf)

    effect = Vibration(MODEL, 5e-5, BrickWall())
    with pytest.raises(InputError, match=r"0\.0\d+ of it still lies more than \d"):
        effect.inverse_at_rest()
