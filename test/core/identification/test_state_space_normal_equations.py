"""The normal equations are those of the simulation error's derivatives."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from test_state_space import random_form
from test_state_space_fit import spectra

from afm_scan_ros.core.identification.state_space.fit import normal_equations
from afm_scan_ros.core.identification.state_space.model import ModalForm


def error(parameters: np.ndarray, form: ModalForm, noise: float) -> np.ndarray:
    """Simulation error of a form of other parameters, on what a form of its own shape made."""
    outputs, inputs = form.feedthrough.shape
    width, size = 1 + outputs + inputs, len(form.poles) * (1 + outputs + inputs)
    terms = (parameters[:size] + 1j * parameters[size : 2 * size]).reshape(-1, width)
    through = parameters[2 * size :].reshape(outputs, inputs)
    moved = ModalForm(terms[:, 0], terms[:, 1 : 1 + outputs], terms[:, 1 + outputs :], through)
    known = spectra(form, noise)
    left = (moved.response(known.z) @ known.inputs - known.outputs).ravel()
    return np.concatenate([left.real, left.imag])


@given(seed=st.integers(0, 1000), outputs=st.integers(1, 3), inputs=st.integers(1, 3))
@settings(deadline=None, max_examples=10)
def test_curvature_and_slope_are_those_of_the_error(seed: int, outputs: int, inputs: int) -> None:
    form, noise = random_form(seed, 2, 1, outputs, inputs), 0.5
    terms = np.column_stack([form.poles, form.left, form.right]).ravel()
    parameters = np.concatenate([terms.real, terms.imag, form.feedthrough.ravel()])
    step = 1e-6
    jacobian = np.stack(
        [
            error(parameters + shift, form, noise) - error(parameters - shift, form, noise)
            for shift in step * np.eye(len(parameters))
        ],
        axis=1,
    ) / (2.0 * step)
    curvature, slope = normal_equations(form, spectra(form, noise))
    scale = np.abs(curvature).max()
    assert_allclose(curvature, jacobian.T @ jacobian, atol=1e-6 * scale)
    left = error(parameters, form, noise)
    assert_allclose(slope, jacobian.T @ left, atol=1e-6 * np.abs(slope).max())
