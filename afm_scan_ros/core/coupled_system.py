"""The inverse of two mutually coupled axes, solved sample by sample.

With o the other axis and z an axis' coupling states, both axes at sample k obey

    x = x_own + c z + share o + curvature o² / 2,    z[k+1] = a z[k] + b o[k]

The states are known before the sample, so two equations in two unknowns remain. They are solved
by Newton's method, which needs one step where both curvatures are zero. The solution at a sample
depends on nothing after it, so blocks can be cut anywhere.
"""

from collections.abc import Iterable

import numpy as np
from attrs import frozen
from numpy.typing import NDArray
from scipy.linalg import block_diag

from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.effects.lti import SampledSystem
from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.types import Array, Trace

STEPS = 20
"""Of Newton's method, each of which squares the error."""
EXACT = 1e-12
"""Last step over the solution; what rounding leaves of it."""
ROUNDING = 1e-7
"""Of an eigenvalue's modulus: a double eigenvalue is known to the root of the machine's epsilon."""
System = tuple[Array, Array, Array, float, float]


@frozen(eq=False)
class SampledCoupling(SampledSystem):
    """What the other axis adds, in m: a linear system of it, and an arc of ``curvature`` (1/m)."""

    curvature: float = 0.0

    def apply(self, state: Array, block: Array) -> tuple[Array, Array]:
        """What a block of the other axis' own displacement (m) adds to this one (m), both (n,)."""
        after, added = super().apply(state, block) if len(state) else (state, self.d * block)
        if self.curvature:
            added += 0.5 * self.curvature * block**2
        return after, added

    @property
    def system(self) -> System:
        """Return a, b, c, share and curvature, as compiled code takes them."""
        return self.a, self.b, self.c, self.d, float(self.curvature)


def memoryless(share: float, curvature: float, sample_period: float) -> SampledCoupling:
    """Return a coupling that adds share o + curvature o² / 2."""
    a, b = np.empty((0, 0)), np.empty(0)
    return SampledCoupling(a, b, b, share, sample_period, curvature=curvature)


def sum_of(parts: Iterable[SampledCoupling], sample_period: float) -> SampledCoupling:
    """Return one coupling that adds what all ``parts`` add."""
    a, b, c, shares, curvatures = zip(
        *(each.system for each in (memoryless(0.0, 0.0, sample_period), *parts)), strict=True
    )
    linear = block_diag(*a), np.concatenate(b), np.concatenate(c), sum(shares)
    return SampledCoupling(*linear, sample_period, curvature=sum(curvatures))


CoupledState = tuple[int, Array, Array]
"""The next sample, and the coupling states of x and of y."""


class CoupledSystem:
    """Both axes, each of which adds to the other; InputError where the inverse is unstable."""

    def __init__(self, to_x: SampledCoupling, to_y: SampledCoupling, sample_period: float) -> None:
        self._to_x, self._to_y = to_x, to_y
        _refuse_unstable(_modes_of_inverse(to_x, to_y), sample_period)

    def at_rest(self) -> CoupledState:
        """State of axes that have long rested at zero."""
        return 0, np.zeros_like(self._to_x.b), np.zeros_like(self._to_y.b)

    def solve(self, before: CoupledState, target: Trace) -> tuple[CoupledState, Trace]:
        """Return the own displacement (m) of each axis for a target (m) of both.

        Raises ScanError naming the sample where no solution can be reached from rest.
        """
        first, states = before[0], (before[1].copy(), before[2].copy())
        own = np.empty_like(target.x), np.empty_like(target.y)
        systems = self._to_x.system, self._to_y.system
        solved = _solve(systems, states, (target.x, target.y), own)
        if solved < len(target.x):
            x, y = (1e6 * float(axis[solved]) for axis in (target.x, target.y))
            raise ScanError(
                f"sample {first + solved}: at x = {x:.6g} um, y = {y:.6g} um the"
                " cross_coupling of both axes has no inverse: scan a smaller range, or remove"
                " cross_coupling from one axis of the model"
            )
        return (first + solved, *states), Trace(target.first_sample, target.sample_period, *own)


def _modes_of_inverse(to_x: SampledCoupling, to_y: SampledCoupling) -> NDArray[np.complex128]:
    """Eigenvalues of the inverse at rest; InputError where the shares alone leave no inverse."""
    left = 1.0 - to_x.d * to_y.d
    if not left > 0.0:
        raise InputError(
            f"cross_coupling: the axes add shares of {to_x.d:.3g} and {to_y.d:.3g} to each"
            " other at once, whose product must be below 1: choose smaller ones"
        )
    mixed = np.array([[1.0, -to_x.d], [-to_y.d, 1.0]]) / left
    free = block_diag(to_x.a, to_y.a)
    seen = block_diag(to_x.c[np.newaxis], to_y.c[np.newaxis])
    driven = block_diag(to_x.b[:, np.newaxis], to_y.b[:, np.newaxis])[:, ::-1]
    return np.linalg.eigvals(free - driven @ mixed @ seen).astype(complex)


def _refuse_unstable(modes: NDArray[np.complex128], sample_period: float) -> None:
    size = np.abs(modes)
    if size.max(initial=0.0) <= 1.0 + ROUNDING:
        return
    worst = modes[size.argmax()]
    frequency = abs(np.angle(worst)) / (2.0 * np.pi * sample_period)
    time = sample_period / np.log(abs(worst))
    raise InputError(
        f"cross_coupling: the inverse of the coupling of both axes is unstable; at {frequency:.4g}"
        f" Hz it grows by a factor of e in {1e3 * time:.3g} ms: remove cross_coupling from one"
        " axis of the model, which is then inverted without it"
    )


@compiled
def _solve(
    systems: tuple[System, System],
    states: tuple[Array, Array],
    targets: tuple[Array, Array],
    own: tuple[Array, Array],
) -> int:
    """Fill what each axis does of itself, move the states, and return how many were solved."""
    (a_x, b_x, c_x, share_x, curve_x), (a_y, b_y, c_y, share_y, curve_y) = systems
    z_x, z_y = states
    next_x, next_y = np.empty_like(z_x), np.empty_like(z_y)
    for k in range(targets[0].size):
        x_left, y_left = targets[0][k], targets[1][k]
        for i in range(z_x.size):
            x_left -= c_x[i] * z_x[i]
        for i in range(z_y.size):
            y_left -= c_y[i] * z_y[i]
        x, y, solved = x_left, y_left, False
        for _ in range(STEPS):
            x_slope, y_slope = share_x + curve_x * y, share_y + curve_y * x
            determinant = 1.0 - x_slope * y_slope
            if not determinant > 0.0:
                return k
            x_miss = x + (share_x + 0.5 * curve_x * y) * y - x_left
            y_miss = y + (share_y + 0.5 * curve_y * x) * x - y_left
            x_step = (x_miss - x_slope * y_miss) / determinant
            y_step = (y_miss - y_slope * x_miss) / determinant
            x, y = x - x_step, y - y_step
            if abs(x_step) + abs(y_step) <= EXACT * (abs(x) + abs(y)):
                solved = True
                break
        if not solved:
            return k
        own[0][k], own[1][k] = x, y
        _advance(a_x, b_x, z_x, y, next_x)
        _advance(a_y, b_y, z_y, x, next_y)
    return int(targets[0].size)


@compiled
def _advance(a: Array, b: Array, state: Array, other: float, scratch: Array) -> None:
    """Move a coupling's states on by one sample of the other axis."""
    for i in range(state.size):
        new = b[i] * other
        for j in range(state.size):
            new += a[i, j] * state[j]
        scratch[i] = new
    state[:] = scratch
