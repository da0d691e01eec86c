"""The response of periodic records: a linear system's own, noise apart from nonlinearity."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from afm_scan_bench.measured.fsm_modes import modes
from afm_scan_bench.measured.mirror.response_matrix import response_matrix
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.state_space.model import ModalForm
from afm_scan_ros.core.identification.state_space.spectra import (
    PeriodicRecords,
    Periods,
    periodic_records,
)
from afm_scan_ros.core.types import Array

PERIOD, SAMPLES = 1e-3, 1024
USED = np.arange(SAMPLES // 2 + 1) * (1.0 / (SAMPLES * PERIOD)) < 450.0
USED[0] = False
MODEL = ModalForm(
    0.7 * np.exp(1j * np.array([0.8, 2.2])),
    np.array([[1.0, 0.5j], [-0.4, 1.0 + 0.2j]]),
    np.array([[0.8, -1.0j], [0.3 + 0.5j, 1.2]]),
    np.array([[0.5, -0.2], [0.1, 1.0]]),
).realised(PERIOD)


def records(noise: float = 0.0, cubic: float = 0.0, count: int = 4) -> PeriodicRecords:
    """Two periods of random-phase realisations, with noise of a given rms."""
    rng = np.random.default_rng(0)
    lines = np.zeros((SAMPLES // 2 + 1, 2, count), dtype=complex)
    lines[1:462] = np.exp(2j * np.pi * rng.random((461, 2, count)))
    drive = np.fft.irfft(lines, SAMPLES, axis=0) * np.sqrt(SAMPLES)

    def through(each: Array) -> Array:
        return MODEL.steady_state(each + cubic * each**3)

    moved = np.stack([through(drive[:, :, k]) for k in range(count)], axis=2)
    output = np.stack([moved, moved], axis=3)
    output = output + noise * rng.standard_normal(output.shape)
    return periodic_records(Periods(np.stack([drive, drive], axis=3), output, PERIOD, USED))


def test_response_of_a_linear_system_is_its_own() -> None:
    found = response_matrix(records())
    assert_allclose(found.response, MODEL.response(found.omega), rtol=1e-9, atol=1e-9)
    assert found.nonlinear.max() < 1e-9
    assert found.noise.max() < 1e-9


def test_noise_and_nonlinearity_are_told_apart() -> None:
    noisy, bent = response_matrix(records(noise=0.1)), response_matrix(records(cubic=0.02))
    assert np.median(noisy.nonlinear) < np.median(noisy.noise)
    assert np.median(bent.noise) < 1e-3 * np.median(bent.nonlinear)


def test_too_few_records_are_refused() -> None:
    with pytest.raises(InputError, match="two sets of 2 are needed"):
        response_matrix(records(count=3))


def test_a_mode_has_the_frequency_and_damping_of_its_pole() -> None:
    rate = 2.0 * np.pi * 120.0 * (-0.02 + 1j * np.sqrt(1.0 - 0.02**2))
    form = ModalForm(
        np.array([np.exp(rate * PERIOD), 0.5 + 0j]),
        np.array([[3.0, 4.0j], [1.0, 0.0]]),
        np.array([[2.0], [1.0]], dtype=complex),
        np.zeros((2, 1)),
    )
    (mode,) = modes(form.realised(PERIOD))
    assert mode.frequency == pytest.approx(120.0, rel=1e-9)
    assert mode.damping == pytest.approx(0.02, rel=1e-9)
    np.testing.assert_allclose(np.abs(mode.left), [0.6, 0.8], rtol=1e-9)
    assert mode.likeness(mode) == pytest.approx(1.0)
