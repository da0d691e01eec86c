"""A rational function of s as numbers to search over: always stable, seen behind the hold.

The denominator is a product of quadratics (and of one first-order factor where the order is odd)
whose coefficients are positive, because their logarithms are searched: no search leaves the left
half-plane. The numerator is linear, in units of the denominator's constant.
"""

import numpy as np
from attrs import field, frozen
from attrs.validators import ge
from numpy.typing import NDArray

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import Array

Complex = NDArray[np.complex128]
ITERATIONS = 20


@frozen
class Order:
    """How many poles and zeros a rational model has; raises InputError unless poles > zeros."""

    poles: int = field(default=4, validator=ge(1))
    zeros: int = field(default=3, validator=ge(0))

    def __attrs_post_init__(self) -> None:
        if self.zeros >= self.poles:
            raise InputError(
                f"order of the vibration model: {self.poles} poles and {self.zeros} zeros; a"
                " scanner's response falls off, so give fewer zeros than poles"
            )

    @property
    def parameters(self) -> int:
        """Real numbers that such a model has."""
        return self.poles + self.zeros + 1

    def __str__(self) -> str:
        return f"{self.poles} poles, {self.zeros} zeros"


PAPER = Order(poles=4, zeros=3)
"""The order of the paper's Eqs. 5 and 8."""


def polynomials(parameters: Array, order: Order) -> tuple[Array, Array]:
    """Numerator and denominator in descending powers of s, of parameters (order.parameters,)."""
    positive, numerator = np.exp(parameters[: order.poles]), parameters[order.poles :]
    denominator = np.ones(1)
    for first in range(0, order.poles, 2):
        denominator = np.polymul(denominator, [1.0, *positive[first : min(first + 2, order.poles)]])
    return numerator * denominator[-1], denominator


def held_response(numerator: Array, denominator: Array, omega: Array, period: float) -> Complex:
    """Zero-order-hold response of numerator/denominator (descending powers of s, simple poles)."""
    poles = np.roots(denominator).astype(np.complex128)
    residues = np.polyval(numerator, poles) / np.polyval(np.polyder(denominator), poles)
    shift = np.exp(1j * omega * period)[:, np.newaxis]
    terms = residues / poles * np.expm1(poles * period) / (shift - np.exp(poles * period))
    return np.asarray(terms.sum(axis=1))


def linear_start(omega: Array, response: Complex, order: Order, period: float) -> Array:
    """Sanathanan-Koerner: linear least squares, each time weighed by the last denominator.

    What the hold does at low frequencies is taken off first, to start near G(jω).
    """
    half = omega * period / 2.0
    response = response / (np.sinc(half / np.pi) * np.exp(-1j * half))
    s, weight = 1j * omega, np.ones_like(omega)
    powers = np.array([s**k for k in range(order.poles + 1)])
    for _ in range(ITERATIONS):
        relative = weight / np.abs(response)
        columns = relative * np.vstack(
            [powers[: order.zeros + 1], -response * powers[: order.poles]]
        )
        target = relative * response * powers[order.poles]
        system = np.hstack([columns.real, columns.imag]).T
        solved = np.linalg.lstsq(system, np.hstack([target.real, target.imag]), rcond=None)[0]
        denominator = np.concatenate([[1.0], solved[: order.zeros : -1]])
        weight = 1.0 / np.abs(np.polyval(denominator, s))
    return _parameters(solved[order.zeros :: -1], denominator)


def _parameters(numerator: Array, denominator: Array) -> Array:
    """Pair the poles, the unstable mirrored, into quadratics; an odd one out is real and last."""
    poles = np.roots(denominator)
    poles = -np.abs(poles.real) + 1j * poles.imag
    upper, real = poles[poles.imag > 0.0], poles[poles.imag == 0.0]
    paired = np.concatenate([np.column_stack([upper, upper.conj()]).ravel(), np.sort(real)])
    factors = [np.poly(paired[first : first + 2]).real[1:] for first in range(0, len(paired), 2)]
    constant = np.prod([factor[-1] for factor in factors])
    return np.concatenate([np.log(np.abs(np.concatenate(factors))), numerator / constant])


def resonance(numerator: Array, denominator: Array) -> tuple[float, float]:
    """Natural frequency and damping ratio of the pole whose partial fraction peaks highest."""
    poles = np.roots(denominator).astype(np.complex128)
    residues = np.polyval(numerator, poles) / np.polyval(np.polyder(denominator), poles)
    peak = poles[np.argmax(np.abs(residues / poles.real))]
    return float(np.abs(peak)), float(-peak.real / np.abs(peak))
