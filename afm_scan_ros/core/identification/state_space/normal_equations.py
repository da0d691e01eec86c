"""JᵀJ and Jᵀe of the simulation error of a modal form, without ever forming J.

The derivative by a parameter is, for each line and record, a function of the line's z times a row
times the inputs. So records enter by the inputs' Gram matrix at each line alone, however many they
are, and the derivatives by all residues by one matrix product over the lines.

A term and its conjugate are first taken for independent: with pole p, left l, right r, inputs v
and s = 1/(z - p) the derivatives are l s² (r·v) by the pole, s (r·v) by l, and l s v by r. The
feedthrough is the ``right`` of terms of which s is 1 and ``left`` are the outputs' unit vectors.
"""

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from afm_scan_ros.core.identification.state_space.model import Complex
from afm_scan_ros.core.identification.state_space.modes import ModalForm
from afm_scan_ros.core.identification.state_space.spectra import Spectra
from afm_scan_ros.core.types import Array


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
