"""Frequency response of a sampled system → the rational vibration model behind its hold.

The converter holds each input sample; the output is sampled just before the next update. What is
fitted is therefore the zero-order-hold response of G(s), not G(jω).
"""

import numpy as np
from attrs import frozen
from numpy.typing import NDArray
from scipy.optimize import least_squares

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.frequency_response import FrequencyResponse
from afm_scan_ros.core.model import VibrationModel
from afm_scan_ros.core.types import Array

Complex = NDArray[np.complex128]
EXPECTED = 1e-3
"""Relative error expected of so short a model of a scanner that has more modes."""
ORDER = 4
"""Poles of the paper's Eqs. 5 and 8, which have one zero fewer."""


@frozen
class RationalFit:
    """The model with its gain at rest set to the gauge, and how well it fits the band.

    ``gain_ratio`` is the gain that the record shows over the gauge: 1 where the input F and the
    gauge agree. ``misfit`` is the rms of the relative error over the lines used.
    """

    model: VibrationModel
    gain_ratio: float
    misfit: float
    band: tuple[float, float]
    """Lowest and highest line used, Hz."""
    resonance: float
    """Frequency of the least damped pole, Hz."""
    damping: float
    """Its damping ratio."""


def fit_rational(
    measured: FrequencyResponse, sample_period: float, gauge: float, highest: float
) -> RationalFit:
    """Fit four poles, all stable, and three zeros to the lines up to ``highest`` Hz.

    The error is weighed by its expected size: the measured scatter, and ``EXPECTED`` of the
    response itself, so that resonance, slope and zeros count alike. ``gauge`` is the
    gain at rest, m/V, that the model is given. Raises InputError where the band holds too few
    lines.
    """
    used = measured.omega <= 2.0 * np.pi * highest
    omega, response = measured.omega[used], measured.response[used]
    if len(omega) < 5 * ORDER:
        raise InputError(
            f"frequency record: {len(omega)} excited lines up to {highest:g} Hz, {5 * ORDER} needed"
        )
    unit = float(omega[-1])
    start = _linear_start(omega / unit, _unheld(omega, response, sample_period) / gauge)
    period = sample_period * unit
    weight = gauge / np.hypot(measured.scatter[used], EXPECTED * np.abs(response))

    def error(parameters: Array) -> Complex:
        return held_response(*_polynomials(parameters), omega / unit, period) - response / gauge

    def residual(parameters: Array) -> Array:
        weighed = weight * error(parameters)
        return np.concatenate([weighed.real, weighed.imag])

    found = least_squares(residual, start, method="lm", xtol=1e-10, ftol=1e-10)
    relative = float(np.sqrt(np.mean(np.abs(error(found.x) * gauge / response) ** 2)))
    return _result(found.x, unit, gauge, relative, (omega[0], omega[-1]))


def held_response(numerator: Array, denominator: Array, omega: Array, period: float) -> Complex:
    """Zero-order-hold response of numerator/denominator (descending powers of s, simple poles)."""
    poles = np.roots(denominator).astype(np.complex128)
    residues = np.polyval(numerator, poles) / np.polyval(np.polyder(denominator), poles)
    shift = np.exp(1j * omega * period)[:, np.newaxis]
    terms = residues / poles * np.expm1(poles * period) / (shift - np.exp(poles * period))
    return np.asarray(terms.sum(axis=1))


def _unheld(omega: Array, response: Complex, sample_period: float) -> Complex:
    """Take off what the hold does at low frequencies, to start near G(jω)."""
    half = omega * sample_period / 2.0
    return np.asarray(response / (np.sinc(half / np.pi) * np.exp(-1j * half)))


def _polynomials(parameters: Array) -> tuple[Array, Array]:
    """Numerator and denominator: the denominator's two quadratics have positive coefficients."""
    first, second = np.exp(parameters[:2]), np.exp(parameters[2:4])
    denominator = np.polymul([1.0, *first], [1.0, *second])
    return parameters[4:] * denominator[-1], denominator


def _linear_start(omega: Array, response: Complex) -> Array:
    """Sanathanan-Koerner: linear least squares, each time weighed by the last denominator."""
    s = 1j * omega
    weight = np.ones_like(omega)
    powers = np.array([s**k for k in range(ORDER + 1)])
    for _ in range(20):
        relative = weight / np.abs(response)
        columns = relative * np.vstack([powers[:ORDER], -response * powers[:ORDER]])
        target = relative * response * powers[ORDER]
        system = np.hstack([columns.real, columns.imag]).T
        solved = np.linalg.lstsq(system, np.hstack([target.real, target.imag]), rcond=None)[0]
        denominator = np.concatenate([[1.0], solved[: ORDER - 1 : -1]])
        weight = 1.0 / np.abs(np.polyval(denominator, s))
    return _parameters(solved[ORDER - 1 :: -1], denominator)


def _parameters(numerator: Array, denominator: Array) -> Array:
    """Pair the poles, the unstable mirrored, into two quadratics."""
    poles = np.roots(denominator)
    poles = -np.abs(poles.real) + 1j * poles.imag
    poles = poles[np.argsort(-np.abs(poles.imag), kind="stable")]
    quadratics = [np.poly(pair).real[1:] for pair in (poles[:2], poles[2:])]
    constant = quadratics[0][1] * quadratics[1][1]
    return np.concatenate([np.log(np.abs(np.concatenate(quadratics))), numerator / constant])


def _result(
    parameters: Array, unit: float, gauge: float, relative: float, band: tuple[float, float]
) -> RationalFit:
    numerator, denominator = _polynomials(parameters)
    ratio = float(parameters[-1])
    scale = unit ** np.arange(ORDER + 1)
    model = VibrationModel(
        numerator=tuple(float(b) for b in gauge / ratio * numerator * scale[1:]),
        denominator=tuple(float(a) for a in denominator * scale),
    )
    poles = np.roots(model.denominator)
    least = poles[np.argmin(-poles.real / np.abs(poles))]
    low, high = (float(edge / (2.0 * np.pi)) for edge in band)
    resonance, damping = np.abs(least) / (2.0 * np.pi), -least.real / np.abs(least)
    return RationalFit(model, ratio, relative, (low, high), float(resonance), float(damping))
