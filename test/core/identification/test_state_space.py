"""Laws of the state-space record: its response, its steady state and its steps agree."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.signal import dlsim

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.state_space.model import (
    ModalForm,
    StateSpaceModel,
    modal_form,
)

PERIOD = 1e-3
SAMPLES = 200


def random_form(seed: int, pairs: int, real: int, outputs: int, inputs: int) -> ModalForm:
    """Well-separated poles of magnitude 0.5 to 0.8: a period of 200 samples forgets the start."""
    rng = np.random.default_rng(seed)
    angles = np.pi * (np.arange(pairs) + rng.uniform(0.3, 0.7, pairs)) / pairs
    poles = np.append(rng.uniform(0.5, 0.8, pairs) * np.exp(1j * angles), np.arange(real) / 4 - 0.6)
    lefts, rights = (
        rng.standard_normal((len(poles), k)) + 1j * rng.standard_normal((len(poles), k))
        for k in (outputs, inputs)
    )
    lefts[pairs:].imag = rights[pairs:].imag = 0.0
    return ModalForm(poles, lefts, rights, rng.standard_normal((outputs, inputs)))


forms = st.builds(
    random_form,
    seed=st.integers(0, 1000),
    pairs=st.integers(1, 4),
    real=st.integers(0, 2),
    outputs=st.integers(1, 3),
    inputs=st.integers(1, 3),
)


@given(form=forms)
@settings(deadline=None)
def test_realised_modes_keep_the_response(form: ModalForm) -> None:
    model = form.realised(PERIOD)
    omega = np.linspace(0.0, np.pi / PERIOD, 50)
    z = np.exp(1j * omega * PERIOD)
    assert model.order == 2 * np.sum(form.poles.imag > 0.0) + np.sum(form.poles.imag == 0.0)
    assert_allclose(model.response(omega), form.response(z), rtol=1e-9, atol=1e-9)
    again = modal_form(model.a, model.b, model.c, model.d)
    assert_allclose(again.response(z), form.response(z), rtol=1e-9, atol=1e-9)


@given(form=forms, seed=st.integers(0, 1000))
@settings(deadline=None)
def test_steps_settle_to_the_steady_state(form: ModalForm, seed: int) -> None:
    model = form.realised(PERIOD)
    inputs = np.random.default_rng(seed).standard_normal((SAMPLES, form.right.shape[1]))
    system = model.a, model.b, model.c, model.d, PERIOD
    _, outputs, _ = dlsim(system, np.tile(inputs, (2, 1)))
    assert_allclose(outputs[SAMPLES:], model.steady_state(inputs), rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize(
    ("a", "c", "word"),
    [
        (np.eye(2), np.ones((1, 2)), "unit circle"),
        (np.zeros((2, 2)), np.ones((1, 3)), "disagree"),
        (np.full((2, 2), np.nan), np.ones((1, 2)), "finite"),
    ],
)
def test_what_is_no_stable_model_is_refused(a: np.ndarray, c: np.ndarray, word: str) -> None:
    with pytest.raises(InputError, match=word):
        StateSpaceModel(a, np.ones((2, 1)), c, np.zeros((1, 1)), PERIOD)


def test_unstable_poles_are_mirrored() -> None:
    form = modal_form(np.array([[2.0]]), np.eye(1), np.eye(1), np.zeros((1, 1)))
    assert not form.reaches(1.0)
    assert_allclose(form.poles, [0.5])
