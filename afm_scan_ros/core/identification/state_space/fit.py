"""Least squares on the simulation error of a modal form: Gauss-Newton damped by Marquardt's way.

The derivative by a parameter is, for each line and record, a function of the line's z times a row
times the inputs. So records enter by the inputs' Gram matrix at each line alone, however many they
are, and the derivatives by all residues by one matrix product over the lines.

A term and its conjugate are first taken for independent: with pole p, left l, right r, inputs v
and s = 1/(z - p) the derivatives are l s² (r·v) by the pole, s (r·v) by l, and l s v by r. The
feedthrough is the ``right`` of terms of which s is 1 and ``left`` are the outputs' unit vectors.

In steady state the simulation error is exactly response · inputs - outputs at each line.

The start is by frequency-domain subspace identification, without iteration: McKelvey, Akçay and
Ljung, Subspace-based multivariable system identification from frequency response data, IEEE
Transactions on Automatic Control 41 (1996) 960-979, algorithm 2, with records of inputs and outputs
in place of the response.
"""

import numpy as np
from attrs import frozen
from numpy.typing import NDArray
from scipy.linalg import qr

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.state_space.model import (
    ModalForm,
    StateSpaceModel,
    modal_form,
)
from afm_scan_ros.core.identification.state_space.spectra import Spectra
from afm_scan_ros.core.types import Array, Complex


def normal_equations(form: ModalForm, spectra: Spectra) -> tuple[Array, Array]:
    """Return JᵀJ and Jᵀe over the parameters.

    They are the real parts of [pole, left, right] of each term, their imaginary parts, and the
    feedthrough.
    """
    terms = _Terms.of(form, spectra)
    curvature, slope = _curvature(terms), _slope(terms)
    order = _order(len(form.poles), *form.feedthrough.shape)
    half = np.asarray(_real(_real(curvature[np.ix_(*2 * (order,))], form).conj().T, form))
    return np.asarray(half.real), np.asarray(_real(slope[order].conj(), form).real)


@frozen(eq=False)
class _Terms:
    """Both halves of the sum, then the feedthrough's terms; Gram matrices at each line."""

    shares: Complex
    """s of each term (lines, terms + p); the last p are 1."""
    left: Complex
    """(terms + p, p); the last p are unit vectors."""
    right: Complex
    """(terms, m)."""
    gram: Complex
    """Inputs by inputs, (lines, m, m)."""
    error: Complex
    """Inputs by simulation error, (lines, m, p)."""

    @classmethod
    def of(cls, form: ModalForm, spectra: Spectra) -> "_Terms":
        halves, outputs = (form, form.conjugate()), form.feedthrough.shape[0]
        poles, left, right = (
            np.concatenate([getattr(half, name) for half in halves])
            for name in ("poles", "left", "right")
        )
        shares = 1.0 / (spectra.z[:, np.newaxis] - poles)
        error = form.response(spectra.z) @ spectra.inputs - spectra.outputs
        adjoint = spectra.inputs.conj()
        return cls(
            np.concatenate([shares, np.ones((len(shares), outputs))], axis=1),
            np.concatenate([left, np.eye(outputs)]),
            right,
            adjoint @ spectra.inputs.swapaxes(1, 2),
            adjoint @ error.swapaxes(1, 2),
        )

    @property
    def driven(self) -> tuple[Complex, Complex]:
        """Functions s and s² of each true term, (lines, 2 terms), and the rows they multiply."""
        own = self.shares[:, : len(self.right)]
        return np.concatenate([own, own**2], axis=1), np.concatenate([self.right, self.right])


def _curvature(terms: _Terms) -> Complex:
    """Gram matrix of the derivatives by all rights, lefts and poles, in this order."""
    count, (wide, outputs) = len(terms.right), terms.left.shape
    inputs = terms.right.shape[1]
    alike = terms.left.conj() @ terms.left.T
    rights = _rights(terms) * alike[:, np.newaxis, :, np.newaxis]
    crossed, driven = _crossed(terms)
    lefts = np.einsum("tqm,qo->toqm", crossed[:count], terms.left)
    poles = crossed[count:] * alike[:count, :, np.newaxis]
    both = np.einsum("tu,op->toup", driven[:count, :count], np.eye(outputs))
    pole_left = driven[count:, :count, np.newaxis] * terms.left[:count].conj()[:, np.newaxis]
    pole_pole = driven[count:, count:] * alike[:count, :count]
    sizes = (wide * inputs, count * outputs, count)
    blocks = {
        (0, 0): rights,
        (1, 0): lefts,
        (1, 1): both,
        (2, 0): poles,
        (2, 1): pole_left,
        (2, 2): pole_pole,
    }
    flat = {(i, j): block.reshape(sizes[i], sizes[j]) for (i, j), block in blocks.items()}
    return np.block(
        [[flat[i, j] if i >= j else flat[j, i].conj().T for j in range(3)] for i in range(3)]
    )


def _rights(terms: _Terms) -> Complex:
    """Σ s̄ s' gram over the lines: (terms + p, m, terms + p, m), one half being the adjoint."""
    lines, wide = terms.shares.shape
    inputs = terms.gram.shape[1]
    first, second = np.triu_indices(wide)
    products = terms.shares[:, first].conj() * terms.shares[:, second]
    summed = (products.T @ terms.gram.reshape(lines, -1)).reshape(-1, inputs, inputs)
    rights = np.empty((wide, wide, inputs, inputs), dtype=np.complex128)
    rights[second, first] = summed.conj().swapaxes(1, 2)
    rights[first, second] = summed
    return rights.swapaxes(1, 2)


def _crossed(terms: _Terms) -> tuple[Complex, Complex]:
    """Products of what lefts and poles multiply with s v, and with themselves."""
    functions, rows = terms.driven
    half = functions.conj()[:, :, np.newaxis] * (rows.conj() @ terms.gram)
    crossed = np.tensordot(half, terms.shares, axes=(0, 0)).swapaxes(1, 2)
    driven = np.einsum("lam,bm,lb->ab", half, rows, functions, optimize=True)
    return np.asarray(crossed), np.asarray(driven)


def _slope(terms: _Terms) -> Complex:
    """Products of the derivatives with the error, in the order of the curvature."""
    count = len(terms.right)
    functions, rows = terms.driven
    rights = np.einsum(
        "lt,lmo,to->tm", terms.shares.conj(), terms.error, terms.left.conj(), optimize=True
    )
    driven = np.einsum("la,am,lmo->ao", functions.conj(), rows.conj(), terms.error, optimize=True)
    poles = np.sum(driven[count:] * terms.left[:count].conj(), axis=1)
    return np.concatenate([rights.ravel(), driven[:count].ravel(), poles])


def _order(terms: int, outputs: int, inputs: int) -> NDArray[np.intp]:
    """Where [pole, left, right] of each term, its conjugate's, and the feedthrough stand."""
    rights = np.arange((2 * terms + outputs) * inputs).reshape(-1, inputs)
    lefts = rights.size + np.arange(2 * terms * outputs).reshape(-1, outputs)
    poles = rights.size + lefts.size + np.arange(2 * terms)[:, np.newaxis]
    table = np.concatenate([poles, lefts, rights[: 2 * terms]], axis=1)
    return np.concatenate([table.ravel(), rights[2 * terms :].ravel()])


def _real(by_half: Complex, form: ModalForm) -> Complex:
    """Derivatives by both halves → by real and imaginary parts, along the last axis."""
    size = len(form.poles) * (1 + form.left.shape[1] + form.right.shape[1])
    upper, lower, rest = np.split(by_half, [size, 2 * size], axis=-1)
    return np.concatenate([upper + lower, 1j * (upper - lower), rest], axis=-1)


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
