"""A known system of several inputs and outputs is recovered from its spectra."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from test_state_space import PERIOD, random_form

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.state_space.fit import (
    fit_state_space,
    gauss_newton,
    squared_error,
    subspace,
)
from afm_scan_ros.core.identification.state_space.model import ModalForm, modal_form
from afm_scan_ros.core.identification.state_space.spectra import Spectra

OMEGA = np.linspace(2.0, 0.95 * np.pi / PERIOD, 300)


def spectra(form: ModalForm, noise: float = 0.0, seed: int = 0) -> Spectra:
    """More records than inputs, each line of the outputs with noise of a given rms."""
    rng = np.random.default_rng(seed)
    outputs, inputs = form.feedthrough.shape
    drive = np.exp(2j * np.pi * rng.random((len(OMEGA), inputs, inputs + 2)))
    followed = form.response(np.exp(1j * OMEGA * PERIOD)) @ drive
    scatter = rng.standard_normal((2, len(OMEGA), outputs, inputs + 2))
    return Spectra(OMEGA, drive, followed + noise * (scatter[0] + 1j * scatter[1]), PERIOD)


@given(
    seed=st.integers(0, 1000),
    outputs=st.integers(1, 3),
    inputs=st.integers(1, 3),
    real=st.integers(0, 1),
)
@settings(deadline=None, max_examples=20)
def test_exact_spectra_give_the_system_back(
    seed: int, outputs: int, inputs: int, real: int
) -> None:
    form = random_form(seed, 3, real, outputs, inputs)
    model = fit_state_space(spectra(form), order=6 + real)
    expected = form.realised(PERIOD)
    assert_allclose(model.response(OMEGA), expected.response(OMEGA), rtol=1e-5, atol=1e-5)
    assert_allclose(np.sort_complex(model.poles), np.sort_complex(expected.poles), atol=1e-5)


@pytest.mark.parametrize("seed", range(4))
def test_refinement_lessens_the_error_and_stays_stable(seed: int) -> None:
    measured = spectra(random_form(seed, 5, 0, 3, 3), noise=0.3, seed=seed).condensed()
    start = subspace(measured, order=8, horizon=12)
    refined = gauss_newton(start, measured)
    assert squared_error(refined, measured) < squared_error(start, measured)
    assert not refined.reaches(1.0)


def test_noise_is_averaged_out() -> None:
    form = random_form(5, 3, 0, 3, 3)
    model = fit_state_space(spectra(form, noise=0.1), order=6)
    expected = form.realised(PERIOD)
    error = np.abs(model.response(OMEGA) - expected.response(OMEGA))
    assert np.sqrt(np.mean(error**2)) < 0.1 / 3.0


def test_minimum_is_stationary() -> None:
    """No small change of a matrix lessens the error at the fit, to first order."""
    measured = spectra(random_form(7, 4, 0, 2, 2), noise=0.5).condensed()
    model = fit_state_space(measured, order=6)
    rng = np.random.default_rng(0)
    least = squared_error(modal_form(model.a, model.b, model.c, model.d), measured)
    for _ in range(10):
        step = 1e-3 * rng.standard_normal(model.b.shape)
        tried = squared_error(modal_form(model.a, model.b + step, model.c, model.d), measured)
        assert tried > (1.0 - 1e-4) * least


def test_horizon_and_lines_must_suffice() -> None:
    measured = spectra(random_form(0, 2, 0, 1, 1))
    with pytest.raises(InputError, match="too short for 4 states"):
        subspace(measured, order=4, horizon=4)
    with pytest.raises(InputError, match="too few for 20 rows"):
        subspace(measured.every(100), order=4, horizon=10)
