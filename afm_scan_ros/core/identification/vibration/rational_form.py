"""A rational function of s as numbers to search over: always stable, seen behind the hold.

The denominator is a product of quadratics s² + 2ζω s + ω² (and of one factor s + ω where the
order is odd) with ω and ζ positive, because their logarithms are searched: no search leaves the
left half-plane. Frequencies are in units of the highest line, so that all numbers are near 1.
"""

import numpy as np
from attrs import field, frozen
from attrs.validators import ge
from numpy.typing import NDArray

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import Array

Complex = NDArray[np.complex128]
RESONANT = 0.5
"""Damping ratio above which a pole is no resonance."""


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
    """Numerator and denominator in descending powers of s, of parameters (order.parameters,).

    First ln ω and ln ζ of each quadratic, then the numerator over the denominator's constant:
    the last parameter is the gain at rest.
    """
    shape, numerator = np.exp(parameters[: order.poles]), parameters[order.poles :]
    denominator = np.ones(1)
    for first in range(0, order.poles - 1, 2):
        omega, zeta = shape[first : first + 2]
        denominator = np.convolve(denominator, [1.0, 2.0 * zeta * omega, omega**2])
    if order.poles % 2:
        denominator = np.convolve(denominator, [1.0, shape[-1]])
    return numerator * denominator[-1], denominator


def held_response(numerator: Array, denominator: Array, omega: Array, period: float) -> Complex:
    """Zero-order-hold response of numerator/denominator (descending powers of s, simple poles).

    ``numerator`` may have more axes before its last; the result has them too, then (lines,).
    """
    poles = np.roots(denominator).astype(np.complex128)
    powers = poles ** np.arange(numerator.shape[-1] - 1, -1, -1)[:, np.newaxis]
    residues = numerator @ powers / np.polyval(np.polyder(denominator), poles)
    shift = np.exp(1j * omega * period)
    held = np.expm1(poles * period) / poles
    sections = held[:, np.newaxis] / (shift - np.exp(poles * period)[:, np.newaxis])
    return np.asarray(residues @ sections)


def resonance(numerator: Array, denominator: Array) -> tuple[float, float]:
    """Natural frequency and damping ratio of the pole in the band that peaks highest.

    The band reaches to frequency 1. Where nothing resonates there, the least damped pole stands.
    """
    poles = np.roots(denominator).astype(np.complex128)
    frequency, damping = np.abs(poles), -poles.real / np.abs(poles)
    residues = np.polyval(numerator, poles) / np.polyval(np.polyder(denominator), poles)
    within = (frequency <= 1.0) & (damping < RESONANT)
    height = np.where(within, np.abs(residues / poles.real), 0.0)
    peak = int(np.argmax(height) if within.any() else np.argmin(damping))
    return float(frequency[peak]), float(damping[peak])
