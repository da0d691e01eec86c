"""A sampled linear system of any number of inputs and outputs, as its four matrices."""

from functools import cached_property

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import Array

Complex = NDArray[np.complex128]

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

    def simulate(self, inputs: Array, state: Array | None = None) -> tuple[Array, Array]:
        """Return outputs (samples, p) of inputs (samples, m), and the state (n,) after them.

        ``state`` is that before the first sample, rest if not given.
        """
        state = np.zeros(self.order) if state is None else state.copy()
        outputs = inputs @ self.d.T
        _step(self.a, self.c, inputs @ self.b.T, state, outputs)
        return outputs, state


@compiled
def _step(a: Array, c: Array, driven: Array, state: Array, outputs: Array) -> None:
    """Add C x to the outputs, x being moved on by A x + ``driven`` at each sample."""
    order = state.size
    following = np.empty(order)
    for k in range(len(driven)):
        for o in range(len(c)):
            for i in range(order):
                outputs[k, o] += c[o, i] * state[i]
        for i in range(order):
            following[i] = driven[k, i]
            for j in range(order):
                following[i] += a[i, j] * state[j]
        state[:] = following
