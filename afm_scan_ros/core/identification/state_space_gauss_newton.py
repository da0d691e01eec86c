"""Least squares on the simulation error of a modal form: Gauss-Newton damped by Marquardt's way.

In steady state the simulation error is exactly outputs - response · inputs at each line. Its
derivatives are those of terms left·rightᵀ / (z - pole) and of their conjugates.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from afm_scan_ros.core.identification.state_space import Complex
from afm_scan_ros.core.identification.state_space_modes import ModalForm
from afm_scan_ros.core.identification.state_space_spectra import Spectra
from afm_scan_ros.core.types import Array

Index = NDArray[np.intp]
STEPS = 50
SETTLED = 1e-4
"""Relative decrease of the squared error below which the fit has settled."""
DAMPING, LEAST_DAMPING, MOST_DAMPING = 1e-3, 1e-9, 1e6
GROWTH, RELIEF = 4.0, 6.0


def squared_error(form: ModalForm, spectra: Spectra) -> float:
    """Sum of the squared simulation error over lines, outputs and records."""
    return float(np.sum(np.abs(_error(form, spectra)) ** 2))


def with_linear_part(form: ModalForm, spectra: Spectra) -> ModalForm:
    """Return the form with the best ``right`` and ``feedthrough`` for its poles and ``left``."""
    width = 1 + form.left.shape[1] + form.right.shape[1]
    linear = np.tile(np.arange(width) >= width - form.right.shape[1], 2 * len(form.poles))
    chosen = _free(form) & np.append(linear, np.ones(form.feedthrough.size, dtype=bool))
    curvature, slope = _normal_equations(form, spectra)
    return _moved(form, chosen, _solved(curvature, slope, chosen, LEAST_DAMPING))


def gauss_newton(form: ModalForm, spectra: Spectra) -> ModalForm:
    """Return the stable form at the nearest minimum of the squared simulation error."""
    cost, damping, free = squared_error(form, spectra), DAMPING, _free(form)
    for _ in range(STEPS):
        curvature, slope = _normal_equations(form, spectra)
        before = cost
        while cost >= before and damping < MOST_DAMPING:
            tried = _moved(form, free, _solved(curvature, slope, free, damping))
            cost = squared_error(tried, spectra) if tried.stable else np.inf
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


def _normal_equations(form: ModalForm, spectra: Spectra) -> tuple[Array, Array]:
    """Return JᵀJ and Jᵀe over all parameters, summed output by output."""
    error, count = _error(form, spectra), len(_parameters(form))
    curvature, slope = np.zeros((count, count)), np.zeros(count)
    for output, (columns, jacobian) in enumerate(_jacobians(form, spectra)):
        stacked = np.concatenate([jacobian.real, jacobian.imag])
        misfit = error[:, output].ravel()
        curvature[np.ix_(columns, columns)] += stacked.T @ stacked
        slope[columns] += stacked.T @ np.concatenate([misfit.real, misfit.imag])
    return curvature, slope


def _jacobians(form: ModalForm, spectra: Spectra) -> Iterator[tuple[Index, Complex]]:
    """For each output, the parameters it depends on and its derivatives (lines · records, ·)."""
    lines, inputs, records = spectra.inputs.shape
    outputs, width = form.left.shape[1], 1 + form.left.shape[1] + inputs
    size = len(form.poles) * width
    starts = width * np.arange(len(form.poles))[:, np.newaxis]
    for output in range(outputs):
        own = np.array([0, 1 + output, *range(1 + outputs, width)])
        terms = (starts + own).ravel()
        through = 2 * size + inputs * output + np.arange(inputs)
        upper, lower = (_derivatives(half, output, spectra) for half in (form, form.conjugate()))
        blocks = np.concatenate([upper + lower, 1j * (upper - lower), spectra.inputs], axis=1)
        jacobian = blocks.swapaxes(1, 2).reshape(lines * records, -1)
        yield np.concatenate([terms, size + terms, through]), jacobian


def _derivatives(form: ModalForm, output: int, spectra: Spectra) -> Complex:
    """Derivatives by pole, this output's left, and right of each term: (lines, ·, records)."""
    share = 1.0 / (spectra.z[:, np.newaxis] - form.poles)[:, :, np.newaxis]
    left = form.left[:, output, np.newaxis]
    driven = form.right @ spectra.inputs
    parts = [
        (left * share**2 * driven)[:, :, np.newaxis],
        (share * driven)[:, :, np.newaxis],
        (left * share)[:, :, np.newaxis] * spectra.inputs[:, np.newaxis],
    ]
    stacked = np.concatenate(parts, axis=2)
    return stacked.reshape(len(share), -1, spectra.inputs.shape[2])
