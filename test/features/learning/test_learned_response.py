"""The response that scans show lies within the variance that is stated of it."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from afm_scan_ros.core.effects.vibration import first_resonance
from afm_scan_ros.core.model import ModelDiscrepancy
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.types import Array
from afm_scan_ros.features.learning.resonance_shift import (
    ModelError,
    ScanSpectra,
    Shift,
    band_edges,
    band_mean,
    fitted_shift,
    local_mean,
)
from afm_scan_ros.features.learning.response import (
    MotionSpectra,
    estimated_response,
    relative_error,
)
from helpers.in_process import default_model

VIBRATION = default_model().x.vibration
RESONANCE = first_resonance(VIBRATION)
HERTZ = np.linspace(0.0, 3000.0, 6001)
KNOWN = (ModelDiscrepancy("loops", (0.0, 3000.0), rms=(1e-9,), noise=(0.0,), displacement=(1e-7,)),)


def complex_noise(rng: np.random.Generator, power: float) -> Array:
    parts = rng.standard_normal((2, len(HERTZ)))
    return np.sqrt(0.5 * power) * (parts[0] + 1j * parts[1])


def shifted(frequency: float, damping: float) -> Array:
    """Ratio of a resonance that has moved to the model's."""
    hertz, ratio = RESONANCE.omega / (2.0 * np.pi), RESONANCE.damping
    before = 1.0 - (HERTZ / hertz) ** 2 + 2j * ratio * HERTZ / hertz
    moved = HERTZ / (frequency * hertz)
    return before / (1.0 - moved**2 + 2j * damping * ratio * moved)


@pytest.mark.evidence
@given(st.integers(0, 999), st.sampled_from([0.93, 1.0, 1.06]))
def test_a_moved_resonance_is_found_with_its_variance(seed: int, factor: float) -> None:
    rng = np.random.default_rng(seed)
    moved = complex_noise(rng, 1.0)
    true = shifted(factor, 1.0)
    noise = np.full(len(HERTZ), 1e-2)
    measured = true * moved
    measured = [measured + complex_noise(rng, 1e-2) for _ in range(2)]
    known = relative_error(KNOWN, HERTZ)
    found = estimated_response(
        VIBRATION, known, HERTZ, MotionSpectra([moved] * 2, measured, noise, 20.0)
    )
    near = np.abs(HERTZ / (factor * RESONANCE.omega / (2.0 * np.pi)) - 1.0) < 0.2
    deviation = np.abs(found.ratio - true)[near] ** 2 / found.variance[near]
    assert np.mean(deviation) < 4.0
    assert np.median(np.abs(found.ratio / true - 1.0)[near]) < 0.1


@given(st.integers(0, 999), st.sampled_from([0.95, 1.04]))
def test_ringing_alone_shows_the_resonance(seed: int, factor: float) -> None:
    """The scan moves too little to show it: what hysteresis excites rings at it."""
    rng = np.random.default_rng(seed)
    gain = np.abs(VIBRATION.response(2.0 * np.pi * HERTZ) / VIBRATION.static_gain)
    error = complex_noise(rng, 1.0) * gain * np.abs(shifted(factor, 1.0))
    still, power = np.zeros(len(HERTZ), complex), np.full(len(HERTZ), 1e6)
    given_error = ModelError(still, error, power, np.full(len(HERTZ), 1e-6))
    found = fitted_shift(VIBRATION, HERTZ, given_error, spacing=10.0)
    assert found is not None
    deviation = 0.0017  # rms over the seeds
    assert np.exp(found.values[1]) == pytest.approx(factor, rel=5.0 * deviation)


@given(st.sampled_from(np.eye(3).tolist()), st.floats(-0.1, 0.1), st.floats(-0.3, 0.3))
def test_the_variance_of_a_ratio_is_that_of_its_slope(
    axis: list[float], frequency: float, damping: float
) -> None:
    hertz, step = RESONANCE.omega / (2.0 * np.pi), 1e-6
    values = np.array([0.01, frequency, damping])
    found = Shift(hertz, RESONANCE.damping, values, np.outer(axis, axis))
    after = Shift(hertz, RESONANCE.damping, values + step * np.array(axis), found.covariance)
    slope = (after.ratio(HERTZ) / found.ratio(HERTZ) - 1.0) / step
    np.testing.assert_allclose(found.variance(HERTZ), np.abs(slope) ** 2, rtol=1e-2, atol=1e-6)


def test_where_nothing_is_known_the_model_may_be_wrong_by_all() -> None:
    found = relative_error(KNOWN, np.array([100.0, 4000.0]))
    np.testing.assert_allclose(found, [0.01, 1.0])


@given(st.integers(8, 3000))
def test_bands_cover_each_frequency_once(count: int) -> None:
    edges = band_edges(count)
    assert edges[0] == 0
    assert edges[-1] == count
    assert (np.diff(edges) >= min(8, count)).all()
    power = np.random.default_rng(count).random(count)
    assert band_mean(power).sum() == pytest.approx(power.sum())


def test_the_mean_of_neighbours_is_the_middle_of_a_straight_line() -> None:
    line = np.arange(100.0)
    np.testing.assert_allclose(local_mean(line)[2:-2], line[2:-2])


def test_a_spectrum_gives_its_signal_back_on_the_lines() -> None:
    spec = ScanSpec(line_rate=20.0, lines=3, samples_per_line=200, preparation_cycles=2)
    spectra = ScanSpectra.of_scan(spec)
    signal = spectra.share * np.random.default_rng(0).standard_normal(len(spectra.share))
    np.testing.assert_allclose(
        spectra.correction(spectra.of(signal)), spectra.share * signal, atol=1e-12
    )
    low = np.where(spectra.frequencies < 500.0, spectra.of(signal), 0.0)
    np.testing.assert_allclose(
        spectra.correction(low[spectra.frequencies < 500.0]), spectra.correction(low), atol=1e-15
    )
    power = np.abs(spectra.of(signal)) ** 2
    rms = np.sqrt(np.mean(signal[spectra.first :] ** 2))
    assert spectra.rms(power) == pytest.approx(rms, rel=1e-3)
