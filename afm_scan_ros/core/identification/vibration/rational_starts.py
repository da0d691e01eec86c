"""Where the search for a rational function begins, and the bounds that it keeps to."""

import numpy as np

from afm_scan_ros.core.identification.vibration.rational_form import Complex, Order
from afm_scan_ros.core.types import Array

ITERATIONS = 20
FREQUENCIES = (1e-3, 30.0)
"""Range of ω searched, over the highest line."""
DAMPINGS = (1e-4, 1e3)
"""Range of ζ searched; above 1 both poles of a quadratic are real."""
BEYOND = np.log([1.7, 0.02])
"""ln ω and ln ζ of a mode beyond the band."""
MARGIN = 1e-3
"""How far a search begins inside its bounds."""


def starts(omega: Array, response: Complex, order: Order, period: float) -> list[Array]:
    """Denominators, (order.poles,) each, to begin a search from.

    One has all poles where linear least squares wants them, the other a pair beyond the band,
    where a mode is that bends the response within.
    """
    found = [_linear_start(omega, response, order, period)]
    poles = order.poles - 2
    if poles > 0:
        fewer = Order(poles, min(order.zeros, poles - 1))
        found.append(np.concatenate([BEYOND, _linear_start(omega, response, fewer, period)]))
    return found


def _linear_start(omega: Array, response: Complex, order: Order, period: float) -> Array:
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
    return _shape(denominator, order)


def _shape(denominator: Array, order: Order) -> Array:
    """Pair the poles, the unstable mirrored, into quadratics; an odd one out is real and last."""
    poles = np.roots(denominator)
    upper, real = poles[poles.imag > 0.0], np.sort(np.abs(poles[poles.imag == 0.0].real))
    pairs = [(np.abs(pole), np.abs(pole.real) / np.abs(pole)) for pole in upper]
    for one, other in zip(real[:-1:2], real[1::2], strict=True):
        omega = np.sqrt(one * other)
        pairs.append((omega, (one + other) / 2.0 / omega))
    shape = np.concatenate([np.ravel(pairs), real[-1:] if order.poles % 2 else []])
    lowest, highest = search_bounds(order)
    return np.asarray(np.clip(np.log(shape), lowest + MARGIN, highest - MARGIN))


def search_bounds(order: Order) -> tuple[Array, Array]:
    """Lowest and highest value of each number of the denominator, (order.poles,)."""
    lowest, highest = np.log([FREQUENCIES, DAMPINGS]).T
    return np.resize(lowest, order.poles), np.resize(highest, order.poles)
