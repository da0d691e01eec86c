"""A sampled linear system of any number of inputs and outputs: four matrices, or a sum of modes.

The modal form has as few parameters as a state-space model of its order can have, but for one
complex scale a term, and its response is cheap to compute and to differentiate.
"""

from functools import cached_property

import numpy as np
from attrs import evolve, frozen
from scipy.linalg import block_diag

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import Array, Complex

LINES_AT_ONCE = 4096
"""Of a response: each takes a matrix of its own."""


@frozen(eq=False, slots=False)
class StateSpaceModel:
    """x[k+1] = A x[k] + B u[k], y[k] = C x[k] + D u[k] with n states, m inputs and p outputs.

    Shapes: ``a`` (n, n), ``b`` (n, m), ``c`` (p, n), ``d`` (p, m); ``sample_period`` in s.
    Raises InputError unless shapes agree, all is finite and every pole lies within the unit circle.
    """

    a: Array
    b: Array
    c: Array
    d: Array
    sample_period: float

    def __attrs_post_init__(self) -> None:
        n = len(self.a)
        shapes = [matrix.shape for matrix in (self.a, self.b, self.c, self.d)]
        if shapes != [(n, n), (n, self.d.shape[1]), (self.d.shape[0], n), self.d.shape]:
            raise InputError(f"state-space model: A, B, C, D have shapes {shapes}, which disagree")
        if not all(np.isfinite(matrix).all() for matrix in (self.a, self.b, self.c, self.d)):
            raise InputError("state-space model: A, B, C, D must be finite numbers")
        if n and np.abs(self.poles).max() >= 1.0:
            raise InputError("state-space model: a pole lies on or beyond the unit circle")

    @cached_property
    def poles(self) -> Complex:
        """Eigenvalues of A, shape (n,)."""
        return np.linalg.eigvals(self.a).astype(np.complex128)

    @property
    def order(self) -> int:
        """Number of states."""
        return len(self.a)

    def response(self, omega: Array) -> Complex:
        """C (z - A)⁻¹ B + D at z = exp(jωT), ``omega`` (lines,) in rad/s: (lines, p, m)."""
        z = np.exp(1j * self.sample_period * np.asarray(omega))[:, np.newaxis, np.newaxis]
        resolvents = (
            np.linalg.solve(part * np.eye(self.order) - self.a, self.b[np.newaxis])
            for part in np.array_split(z, 1 + len(z) // LINES_AT_ONCE)
        )
        return np.concatenate([self.c @ each + self.d for each in resolvents])

    def steady_state(self, inputs: Array) -> Array:
        """Outputs (samples, p) of the steady state under a period of inputs (samples, m); exact."""
        samples = len(inputs)
        omega = np.asarray(2.0 * np.pi * np.fft.rfftfreq(samples, self.sample_period))
        spectrum = np.fft.rfft(inputs, axis=0)[:, :, np.newaxis]
        return np.fft.irfft((self.response(omega) @ spectrum)[:, :, 0], samples, axis=0)


@frozen(eq=False)
class ModalForm:
    """D + Σ left·rightᵀ / (z - pole) + its conjugate, over poles on or above the real axis.

    Shapes: ``poles`` (terms,), ``left`` (terms, p), ``right`` (terms, m), ``feedthrough`` (p, m),
    real. A real pole is its own conjugate: its vectors are real, and it counts as one state.
    """

    poles: Complex
    left: Complex
    right: Complex
    feedthrough: Array

    def reaches(self, modulus: float) -> bool:
        """Whether a pole is of more than a modulus."""
        return bool(np.any(np.abs(self.poles) > modulus))

    def within(self, modulus: float) -> "ModalForm":
        """Return the form with poles of more than a modulus, if any, moved to it."""
        beyond = np.maximum(np.abs(self.poles) / modulus, 1.0)
        return evolve(self, poles=np.where(beyond > 1.0, self.poles / beyond, self.poles))

    def response(self, z: Complex) -> Complex:
        """Response at points ``z`` (lines,) of the unit circle: (lines, p, m)."""
        result = np.zeros((len(z), *self.feedthrough.shape), dtype=np.complex128)
        for terms in (self, self.conjugate()):
            shares = 1.0 / (z[:, np.newaxis] - terms.poles)
            residues = terms.left[:, :, np.newaxis] * terms.right[:, np.newaxis, :]
            result += np.tensordot(shares, residues, axes=1)
        return np.asarray(result + self.feedthrough)

    def conjugate(self) -> "ModalForm":
        """Return the other half of the sum."""
        return ModalForm(self.poles.conj(), self.left.conj(), self.right.conj(), self.feedthrough)

    def realised(self, sample_period: float) -> StateSpaceModel:
        """Return the real state-space model whose A is made of 2 x 2 and 1 x 1 blocks."""
        blocks, inputs, outputs = [], [], []
        for pole, left, right in zip(self.poles, self.left, self.right, strict=True):
            if pole.imag == 0.0:
                blocks.append(np.array([[pole.real]]))
                inputs.append(right.real[np.newaxis])
                outputs.append(2.0 * left.real[:, np.newaxis])
            else:
                blocks.append(np.array([[pole.real, -pole.imag], [pole.imag, pole.real]]))
                inputs.append(np.array([right.real, right.imag]))
                outputs.append(2.0 * np.array([left.real, -left.imag]).T)
        return StateSpaceModel(
            block_diag(*blocks),
            np.vstack(inputs),
            np.hstack(outputs),
            self.feedthrough,
            sample_period,
        )


def modal_form(a: Array, b: Array, c: Array, d: Array) -> ModalForm:
    """Return the modes of four matrices; poles beyond the unit circle are mirrored at it.

    Raises numpy's LinAlgError where A has no full set of eigenvectors.
    """
    values, vectors = np.linalg.eig(a)
    upper = values.imag >= 0.0
    poles = values[upper].astype(np.complex128)
    left = (c @ vectors[:, upper]).T.astype(np.complex128)
    right = np.linalg.solve(vectors, b.astype(np.complex128))[upper]
    left[poles.imag == 0.0] /= 2.0
    beyond = np.abs(poles) >= 1.0
    poles[beyond] = 1.0 / poles[beyond].conj()
    return ModalForm(poles, left, right, d)
