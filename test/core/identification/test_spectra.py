"""Responses between several inputs and outputs, with what is known of them."""

import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.vibration.spectra import RecordSpectra, response_matrix

Complex = NDArray[np.complex128]
MEASURED = (
    Path(os.environ.get("AFM_SCAN_DATA", Path(__file__).parents[4] / "shared/data")) / "piezo_fsm"
)
LINES = 40
OMEGA = np.arange(1.0, LINES + 1.0)


def draw(rng: np.random.Generator, *shape: int) -> Complex:
    return rng.standard_normal(shape) + 1j * rng.standard_normal(shape)


def phases(rng: np.random.Generator, *shape: int) -> Complex:
    return np.exp(2j * np.pi * rng.random(shape))


def through(response: Complex, inputs: Complex) -> Complex:
    return np.einsum("loi,rli->rlo", response, inputs)


def spectra(
    inputs: Complex, outputs: Complex, noise: float = 0.0, periods: float = 4.0
) -> RecordSpectra:
    waves = len(inputs)
    variance = np.full(outputs.shape, noise)
    return RecordSpectra(OMEGA, inputs, outputs, variance, np.full(waves, periods))


@settings(max_examples=25, deadline=None)
@given(
    inputs=st.integers(1, 4),
    outputs=st.integers(1, 3),
    spare=st.integers(0, 3),
    seed=st.integers(0, 99),
)
def test_any_number_of_inputs_and_outputs_is_recovered(
    inputs: int, outputs: int, spare: int, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    true, given_ = draw(rng, LINES, outputs, inputs), draw(rng, inputs + spare, LINES, inputs)
    found = response_matrix(spectra(given_, through(true, given_)))
    np.testing.assert_allclose(found.response, true, rtol=1e-6, atol=1e-7)
    np.testing.assert_allclose(found.coherence, 1.0, atol=1e-9)


def test_deviations_are_those_of_repeated_experiments() -> None:
    rng = np.random.default_rng(1)
    true, given_ = draw(rng, LINES, 1, 2), phases(rng, 6, LINES, 2)
    errors, scatters, noises = [], [], []
    for _ in range(300):
        measured = through(true, given_) + 0.1 * draw(rng, 6, LINES, 1) / np.sqrt(2.0)
        found = response_matrix(spectra(given_, measured, noise=0.01))
        errors.append(found.response - true)
        scatters.append(found.scatter)
        noises.append(found.noise)
    actual = np.sqrt(np.mean(np.abs(errors) ** 2, axis=0))
    assert np.median(np.sqrt(np.mean(np.square(scatters), axis=0)) / actual) == pytest.approx(
        1.0, abs=0.05
    )
    assert np.median(np.mean(noises, axis=0) / actual) == pytest.approx(1.0, abs=0.05)


def test_wave_noisier_between_its_periods_counts_less() -> None:
    rng = np.random.default_rng(2)
    given_ = phases(rng, 6, LINES, 1)
    size = np.array([5.0, 5.0, 0.1, 0.1, 0.1, 0.1])[:, np.newaxis, np.newaxis]
    measured = given_ + size * draw(rng, 6, LINES, 1) / np.sqrt(2.0)
    noise = np.broadcast_to(size**2, measured.shape)
    found = response_matrix(RecordSpectra(OMEGA, given_, measured, noise, np.full(6, 2.0)))
    assert found.weights[:2].max() < 0.05 * found.weights[2:].min()
    assert found.weights.mean() == pytest.approx(1.0)
    assert np.sqrt(np.mean(np.abs(found.response - 1.0) ** 2)) < 0.1


@pytest.mark.parametrize("share", [0.01, 0.3])
def test_coherence_is_the_share_of_power_explained(share: float) -> None:
    rng = np.random.default_rng(3)
    given_ = phases(rng, 400, LINES, 1)
    variance = share / (1.0 - share)
    periods = np.sqrt(variance / 2.0) * draw(rng, 400, 2, LINES, 1)
    measured = given_ + periods.mean(axis=1)
    noise = np.var(periods, axis=1, ddof=1) / 2.0
    found = response_matrix(RecordSpectra(OMEGA, given_, measured, noise, np.full(400, 2.0)))
    np.testing.assert_allclose(found.coherence.mean(), 1.0 - share, atol=0.01)


def test_inputs_that_cannot_be_distinguished_are_refused() -> None:
    rng = np.random.default_rng(4)
    one = draw(rng, 3, LINES, 1)
    alike = np.concatenate([one, one], axis=2)
    with pytest.raises(InputError, match="3 waves cannot separate 2 inputs"):
        response_matrix(spectra(alike, one))
    few = draw(rng, 2, LINES, 3)
    with pytest.raises(InputError, match="at least 3 waves"):
        response_matrix(spectra(few, one[:2]))


def test_levels_are_distinguished_from_draws_of_the_phases() -> None:
    rng = np.random.default_rng(5)
    size = np.array([0.2, 1.0, 1.1, 0.95, 0.1])
    found = spectra(
        size[:, np.newaxis, np.newaxis] * phases(rng, 5, LINES, 1), np.ones((5, LINES, 1))
    )
    levels = [level.amplitudes / np.sqrt(LINES) for level in found.levels()]
    assert [sorted(level.round(2)) for level in levels] == [[0.95, 1.0, 1.1], [0.2], [0.1]]


def steering_mirror(millivolts: int) -> RecordSpectra:
    """Six realisations of two periods of three inputs and outputs at 6400 Hz.

    From github merijnfloren/fsm-benchmark-data, CC BY 4.0, (c) 2025 Merijn Floren, KU Leuven.
    """
    signals = (np.load(MEASURED / f"{name}_{millivolts}mV_train.npy") for name in "uy")
    given_, got = (np.fft.rfft(s, axis=0).transpose(2, 3, 0, 1) for s in signals)
    strength = np.abs(given_).mean(axis=(0, 1, 3))
    strength[0] = 0.0
    lines = np.flatnonzero(strength > 1e-3 * strength.max())
    given_, got = given_[:, :, lines], got[:, :, lines]
    noise = np.var(got, axis=1, ddof=1) / 2.0
    omega = 2.0 * np.pi * lines * 6400.0 / 8192.0
    return RecordSpectra(omega, given_.mean(axis=1), got.mean(axis=1), noise, np.full(6, 2.0))


@pytest.mark.skipif(not MEASURED.is_dir(), reason=f"no measurements at {MEASURED}: AFM_SCAN_DATA")
def test_measured_mirror_softens_and_its_noisy_realisations_count_less() -> None:
    modes = []
    for millivolts in (100, 200, 300):
        found = response_matrix(steering_mirror(millivolts))
        frequency = found.omega / (2.0 * np.pi)
        near = (frequency > 950.0) & (frequency < 1050.0)
        modes.append(frequency[near][np.abs(found.response[near, 0, 0]).argmax()])
        assert found.coherence[near].min() > 0.98
        if millivolts == 100:
            noisy, quiet = found.weights[[1, 2]], found.weights[[0, 3, 4, 5]]
            assert noisy.max() < 0.8
            assert quiet.min() > 1.1
    assert 1005.0 > modes[0] > modes[1] > modes[2] > 980.0
