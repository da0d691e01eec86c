"""Least squares on the simulation error of a modal form: Gauss-Newton damped by Marquardt's way.

In steady state the simulation error is exactly response · inputs - outputs at each line.

Frequency-domain subspace identification: spectra → modes, without a start and without iteration.

McKelvey, Akçay and Ljung, Subspace-based multivariable system identification from frequency
response data, IEEE Transactions on Automatic Control 41 (1996) 960-979, algorithm 2, with records
of inputs and outputs in place of the response.

Spectra → a stable state-space model of given order with the least simulation error.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import qr

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.state_space.model import Complex, StateSpaceModel
from afm_scan_ros.core.identification.state_space.modes import ModalForm, modal_form
from afm_scan_ros.core.identification.state_space.normal_equations import normal_equations
from afm_scan_ros.core.identification.state_space.spectra import Spectra
from afm_scan_ros.core.types import Array

STEPS = 50
SETTLED = 1e-4
"""Relative decrease of the squared error below which the fit has settled."""
DAMPING, LEAST_DAMPING, MOST_DAMPING = 1e-3, 1e-9, 1e6
ROUNDING = 1e-12
GROWTH, RELIEF = 4.0, 6.0


def squared_error(form: ModalForm, spectra: Spectra) -> float:
    """Sum of the squared simulation error over lines, outputs and records."""
    return float(np.sum(np.abs(_error(form, spectra)) ** 2))


def with_linear_part(form: ModalForm, spectra: Spectra) -> ModalForm:
    """Return the form with the best ``right`` and ``feedthrough`` for its poles and ``left``."""
    width = 1 + form.left.shape[1] + form.right.shape[1]
    linear = np.tile(np.arange(width) >= width - form.right.shape[1], 2 * len(form.poles))
    chosen = _free(form) & np.append(linear, np.ones(form.feedthrough.size, dtype=bool))
    curvature, slope = normal_equations(form, spectra)
    return _moved(form, chosen, _solved(curvature, slope, chosen, LEAST_DAMPING))


def gauss_newton(form: ModalForm, spectra: Spectra) -> ModalForm:
    """Return the form at the nearest minimum of the squared simulation error.

    No pole is slower than the lines resolve: such a one would fit noise, and stray between them.
    """
    form, slowest = form.within(spectra.slowest), spectra.slowest * (1.0 + ROUNDING)
    cost, damping, free = squared_error(form, spectra), DAMPING, _free(form)
    for _ in range(STEPS):
        curvature, slope = normal_equations(form, spectra)
        before = cost
        while cost >= before and damping < MOST_DAMPING:
            tried = _moved(form, free, _solved(curvature, slope, free, damping))
            cost = squared_error(tried, spectra) if not tried.reaches(slowest) else np.inf
            damping *= GROWTH
        if cost >= before:
            break
        form, damping = tried, max(damping / (GROWTH * RELIEF), LEAST_DAMPING)
        if before - cost < SETTLED * before:
            break
    return form


def _error(form: ModalForm, spectra: Spectra) -> Complex:
    return np.asarray(form.response(spectra.z) @ spectra.inputs - spectra.outputs)


def _parameters(form: ModalForm) -> Array:
    """Real parts of [pole, left, right] of each term, their imaginary parts, the feedthrough."""
    terms = np.column_stack([form.poles, form.left, form.right]).ravel()
    return np.concatenate([terms.real, terms.imag, form.feedthrough.ravel()])


def _moved(form: ModalForm, chosen: NDArray[np.bool_], step: Array) -> ModalForm:
    """Subtract a step of the chosen parameters."""
    parameters = _parameters(form)
    parameters[chosen] -= step
    outputs, width = form.left.shape[1], 1 + form.left.shape[1] + form.right.shape[1]
    size = len(form.poles) * width
    terms = (parameters[:size] + 1j * parameters[size : 2 * size]).reshape(-1, width)
    feedthrough = parameters[2 * size :].reshape(form.feedthrough.shape)
    return ModalForm(terms[:, 0], terms[:, 1 : 1 + outputs], terms[:, 1 + outputs :], feedthrough)


def _free(form: ModalForm) -> NDArray[np.bool_]:
    """All parameters but the imaginary parts of a real pole's term."""
    width = 1 + form.left.shape[1] + form.right.shape[1]
    imaginary = np.repeat(form.poles.imag != 0.0, width)
    return np.concatenate(
        [np.ones_like(imaginary), imaginary, np.ones(form.feedthrough.size, dtype=bool)]
    )


def _solved(curvature: Array, slope: Array, chosen: NDArray[np.bool_], damping: float) -> Array:
    """Step of the chosen parameters, damped in proportion to their own curvature."""
    matrix, right = curvature[np.ix_(chosen, chosen)], slope[chosen]
    scale = np.sqrt(np.maximum(matrix.diagonal(), np.finfo(float).tiny))
    matrix = matrix / np.outer(scale, scale) + damping * np.eye(len(right))
    return np.asarray(np.linalg.solve(matrix, right / scale) / scale)


def subspace(spectra: Spectra, order: int, horizon: int) -> ModalForm:
    """Return a stable model with ``order`` states from matrices of ``horizon`` block rows.

    Raises InputError where the horizon is too short for the order, or the lines are too few.
    """
    inputs, outputs = spectra.inputs.shape[1], spectra.outputs.shape[1]
    rows = horizon * (inputs + outputs)
    if (horizon - 1) * outputs < order:
        raise InputError(f"subspace: a horizon of {horizon} is too short for {order} states")
    if 2 * len(spectra.omega) * spectra.inputs.shape[2] < rows:
        raise InputError(f"subspace: {len(spectra.omega)} lines are too few for {rows} rows")
    driven, followed = (_shifted(spectra.z, s, horizon) for s in (spectra.inputs, spectra.outputs))
    triangle = qr(np.vstack([driven, followed]).T, mode="r", overwrite_a=True)[0]
    free = triangle[horizon * inputs : rows, horizon * inputs :].T
    observability = np.linalg.svd(free)[0][:, :order]
    a = np.linalg.lstsq(observability[:-outputs], observability[outputs:], rcond=None)[0]
    c = observability[:outputs]
    poles = modal_form(a, np.zeros((order, inputs)), c, np.zeros((outputs, inputs)))
    return with_linear_part(poles, spectra)


def _shifted(z: Complex, signals: Complex, horizon: int) -> Array:
    """Stack z⁰, z¹, … times the signals: (horizon · channels, 2 · lines · records), real."""
    powers = z ** np.arange(horizon)[:, np.newaxis]
    stacked = np.einsum("hk,kcr->hckr", powers, signals)
    wide = stacked.reshape(horizon * signals.shape[1], -1)
    return np.hstack([wide.real, wide.imag])


COARSE_LINES = 900
"""Lines on which the starts are found and compared; the best of them is refined on all."""


def fit_state_space(spectra: Spectra, order: int) -> StateSpaceModel:
    """Fit ``order`` states by subspaces of two horizons, each refined on its simulation error.

    Two, since the error has several minima. Raises InputError where the lines are too few, or
    the records do not drive all inputs independently.
    """
    condensed = spectra.condensed()
    coarse = condensed.every(max(1, len(spectra.omega) // COARSE_LINES))
    starts = [subspace(coarse, order, horizon) for horizon in (order + 2, order + 6)]
    refined = [gauss_newton(start, coarse) for start in starts]
    best = min(refined, key=lambda form: squared_error(form, coarse))
    return gauss_newton(best, condensed).realised(spectra.sample_period)


def refined(start: StateSpaceModel, spectra: Spectra) -> StateSpaceModel:
    """Return the model nearest to a start with the least simulation error; raises as above."""
    form = modal_form(start.a, start.b, start.c, start.d)
    return gauss_newton(form, spectra.condensed()).realised(spectra.sample_period)
