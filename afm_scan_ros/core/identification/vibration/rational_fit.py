"""Frequency response of a sampled system → the rational vibration model behind its hold.

The converter holds each input sample; the output is sampled just before the next update. What is
fitted is therefore the zero-order-hold response of G(s), not G(jω). The fit maximises the
likelihood of the scatter, widened by what so short a model must be expected to miss.

The denominator is a product of quadratics s² + 2ζω s + ω² (and of one factor s + ω where the
order is odd) with ω and ζ positive, because their logarithms are searched: no search leaves the
left half-plane. Frequencies are in units of the highest line, so that all numbers are near 1. The
poles are searched from several starts; for each choice of them the numerator follows by linear
least squares (variable projection).
"""

from collections.abc import Sequence

import numpy as np
from attrs import field, frozen
from attrs.validators import ge
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import OptimizeResult, least_squares

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.findings import Finding
from afm_scan_ros.core.identification.vibration.line_response import FrequencyResponse, smooth
from afm_scan_ros.core.identification.vibration.response_checks import response_findings
from afm_scan_ros.core.least_squares import (
    Interval,
    intervals_95,
    sandwich,
    slopes,
)
from afm_scan_ros.core.model import VibrationModel
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


def slowest(numerator: ArrayLike, denominator: ArrayLike) -> float:
    """Frequency of the slowest pole or zero, in the polynomials' unit.

    No line shows one below all lines, and it changes the gain at rest by what it likes.
    """
    return float(np.abs(np.concatenate([np.roots(numerator), np.roots(denominator)])).min())


ITERATIONS = 20
BELOW, ABOVE = 0.1, 30.0
"""Range of ω searched, over the lowest and over the highest line."""
DAMPINGS = (1e-4, 1e3)
"""Range of ζ searched; above 1 both poles of a quadratic are real."""
BEYOND = np.log([1.7, 0.02])
"""ln ω and ln ζ of a mode beyond the band."""
TRIED, MOST = 12, 200
"""Steps from each start, and from the best of them on."""
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
    return _shape(denominator, order, omega)


def _shape(denominator: Array, order: Order, lines: Array) -> Array:
    """Pair the poles, the unstable mirrored, into quadratics; an odd one out is real and last."""
    poles = np.roots(denominator)
    upper, real = poles[poles.imag > 0.0], np.sort(np.abs(poles[poles.imag == 0.0].real))
    pairs = [(np.abs(pole), np.abs(pole.real) / np.abs(pole)) for pole in upper]
    for one, other in zip(real[:-1:2], real[1::2], strict=True):
        omega = np.sqrt(one * other)
        pairs.append((omega, (one + other) / 2.0 / omega))
    shape = np.concatenate([np.ravel(pairs), real[-1:] if order.poles % 2 else []])
    lowest, highest = search_bounds(order, lines)
    return np.asarray(np.clip(np.log(shape), lowest + MARGIN, highest - MARGIN))


def search_bounds(order: Order, omega: Array) -> tuple[Array, Array]:
    """Lowest and highest value of each number of the denominator, (order.poles,), for lines."""
    lowest, highest = np.log([(BELOW * omega[0], ABOVE), DAMPINGS]).T
    return np.resize(lowest, order.poles), np.resize(highest, order.poles)


EXPECTED = 1e-3
"""Relative error expected of so short a model of a scanner that has more modes."""
EVENLY = np.exp(0.25j * np.pi)
"""1 turned so that its real and imaginary parts are alike."""


def correlated(error: Complex) -> float:
    """Sum of the autocorrelation of an error, (lines,), over lags while it stays above chance."""
    count = len(error)
    power = np.abs(np.fft.fft(error - error.mean(), 2 * count)) ** 2
    correlation = np.fft.ifft(power)[: max(count // 4, 2)].real
    if correlation[0] <= 0.0:
        return 1.0
    correlation /= correlation[0]
    ends = np.flatnonzero(correlation < 1.0 / np.sqrt(count))
    within = correlation[1 : ends[0]] if len(ends) else correlation[1:]
    return float(1.0 + 2.0 * within.sum())


@frozen(eq=False)
class Band:
    """The lines used, shape (lines,), with the highest for the unit of frequency."""

    omega: Array
    response: Complex
    """In units of the gauge, as is ``deviation``, the expected size of its error."""
    deviation: Array
    period: float
    unit: float
    """rad/s"""
    gauge: float
    order: Order

    @classmethod
    def of(
        cls, used: FrequencyResponse, sample_period: float, gauge: float, order: Order
    ) -> "Band":
        """Take lines of a response (m/V); ``gauge`` in m/V."""
        unit = float(used.omega[-1])
        response, deviation = used.response / gauge, used.deviation / gauge
        period = sample_period * unit
        return cls(used.omega / unit, response, deviation, period, unit, gauge, order)

    def error(self, parameters: Array) -> Complex:
        """Model less measurement, (lines,)."""
        model = held_response(*polynomials(parameters, self.order), self.omega, self.period)
        return model - self.response

    def weighed(self, error: Complex) -> Array:
        """Real and imaginary parts, one after the other on the last axis, over their size."""
        weighed = error / np.hypot(self.deviation, EXPECTED * np.abs(self.response))
        return np.concatenate([weighed.real, weighed.imag], axis=-1)

    def residual(self, parameters: Array) -> Array:
        """Error as least squares counts it, (2 lines,)."""
        return self.weighed(self.error(parameters))

    def _columns(self, shape: Array) -> Array:
        """What each number of the numerator adds to the residual, (2 lines, order.zeros + 1)."""
        count = self.order.zeros + 1
        denominator = polynomials(np.concatenate([shape, np.zeros(count)]), self.order)[1]
        columns = held_response(
            denominator[-1] * np.eye(count), denominator, self.omega, self.period
        )
        return self.weighed(columns).T

    def numerator(self, shape: Array) -> Array:
        """Best numerator for a denominator's numbers: linear least squares."""
        given = self.weighed(self.response)
        return np.asarray(np.linalg.lstsq(self._columns(shape), given, rcond=None)[0])

    def projected(self, shape: Array) -> Array:
        """Residual of a denominator's numbers with the best numerator: fewer to search over."""
        return self.residual(np.concatenate([shape, self.numerator(shape)]))

    def projected_slopes(self, shape: Array) -> Array:
        """Derivatives of ``projected``, (2 lines, order.poles), less what no numerator can mend.

        The part left out is orthogonal to the residual, so that the gradient is exact (L. Kaufman,
        BIT 15, 49 (1975)).
        """
        numerator, values = self.numerator(shape), np.exp(shape)

        def residual(values: Array) -> Array:
            return self.residual(np.concatenate([np.log(values), numerator]))

        along = slopes(residual, values) * values
        base = np.linalg.qr(self._columns(shape))[0]
        return np.asarray(along - base @ (base.T @ along))

    def spread(self, error: Complex, along: Array) -> Array:
        """Standard deviation of the residual, (2 lines,), for the parameters' variance.

        ``error``, (lines,), is what the model misses, ``along`` the residual's derivatives. A
        line's variance is that of its scatter, or of the misses about it where these are larger,
        each over the share of it that is free. Errors that neighbouring lines have in common
        count as often as lines are alike: variance times the sum of the autocorrelation (G. M.
        Jenkins and D. G. Watts, Spectral Analysis, 1968, section 5.3). Half of it lies in the real
        part and half in the imaginary.
        """
        known = np.maximum(self.deviation, np.finfo(float).eps * np.abs(self.response))
        base = np.linalg.qr(along / np.linalg.norm(along, axis=0))[0]
        taken = np.sum((base**2).reshape(2, len(error), -1), axis=(0, 2)) / 2.0
        free_share = np.maximum(1.0 - taken, 1.0 / len(error))
        relative = error / known
        excess = np.maximum(smooth(np.abs(relative) ** 2 / free_share), 1.0)
        alike = correlated(relative / np.sqrt(excess))
        return np.asarray(self.weighed(known * np.sqrt(excess * alike) * EVENLY))

    def figures(self, parameters: Array) -> Array:
        """Resonance (Hz), damping ratio and gain over the gauge."""
        frequency, damping = resonance(*polynomials(parameters, self.order))
        return np.array([frequency * self.unit / (2.0 * np.pi), damping, parameters[-1]])


def search(band: Band, begin: Sequence[Array]) -> Array:
    """Most likely parameters, (order.parameters,), that the starts lead to.

    A start is a denominator, (order.poles,). Of all, the one that is best after ``TRIED`` steps is
    followed to its end.
    """
    low, high = search_bounds(band.order, band.omega)

    def end(start: Array, steps: int) -> OptimizeResult:
        inside = np.clip(start, low + MARGIN, high - MARGIN)
        return least_squares(
            band.projected,
            inside,
            band.projected_slopes,
            bounds=(low, high),
            xtol=1e-9,
            ftol=1e-9,
            max_nfev=steps,
        )

    tried = min((end(start, TRIED) for start in begin), key=lambda each: float(each.cost))
    shape = (tried if tried.status else end(tried.x, MOST)).x
    return np.concatenate([shape, band.numerator(shape)])


LINES_PER_POLE = 5


@frozen
class RationalFit:
    """The model with its gain at rest set to the gauge, and how well it fits the band.

    ``gain_ratio`` is the gain that the record shows over the gauge: 1 where the input F and the
    gauge agree. ``misfit`` is the rms of the relative error over the lines used. An interval
    holds 95 % of what the scatter from wave to wave would give; it assumes that the model's order
    is the scanner's.
    """

    model: VibrationModel
    gain_ratio: float
    misfit: float
    band: Interval
    """Lowest and highest line used, Hz."""
    resonance: float
    """Frequency of the pole with the highest peak, Hz."""
    damping: float
    """Its damping ratio."""
    resonance_interval: Interval
    """Hz."""
    damping_interval: Interval
    gain_interval: Interval
    """Of ``gain_ratio``; infinite where the lines do not identify it."""
    noise_share: float
    """Noise of the response over the response, rms over the band."""
    nonlinearity_share: float
    """The same of what differs from wave to wave beyond the noise."""
    warnings: tuple[Finding, ...]
    """What the record does not determine."""

    @property
    def order(self) -> Order:
        """Poles and zeros of the model."""
        return Order(len(self.model.denominator) - 1, len(self.model.numerator) - 1)

    @property
    def identifies_gain(self) -> bool:
        """Whether the lines show every pole and zero that the gain at rest depends on."""
        lowest = 2.0 * np.pi * self.band[0]
        return slowest(self.model.numerator, self.model.denominator) >= lowest


def fit_rational(
    measured: FrequencyResponse,
    sample_period: float,
    gauge: float,
    order: Order = PAPER,
    begin: Sequence[Array] = (),
) -> RationalFit:
    """Fit a model of ``order``, all poles stable, to every line.

    The error is weighed by its expected size: the measured scatter, and ``EXPECTED`` of the
    response itself, so that resonance, slope and zeros count alike. ``gauge`` is the
    gain at rest, m/V, that the model is given; ``begin`` are starts as for ``search``, in place of
    those that the response suggests. Raises InputError where there are too few lines.
    """
    lines, needed = len(measured.omega), LINES_PER_POLE * order.poles
    if lines < needed:
        highest = f" up to {measured.frequency[-1]:.4g} Hz" if lines else ""
        raise InputError(
            f"frequency record: {lines} excited lines{highest}, {needed} needed for {order};"
            " drive more of them"
        )
    band = Band.of(measured, sample_period, gauge, order)
    parameters = search(band, begin or starts(band.omega, band.response, order, band.period))
    along = slopes(band.residual, parameters)
    spread = sandwich(along, band.spread(band.error(parameters), along))
    return _result(parameters, spread, band, measured)


def _result(parameters: Array, spread: Array, band: Band, used: FrequencyResponse) -> RationalFit:
    frequency, damping, ratio = (float(value) for value in band.figures(parameters))
    intervals = intervals_95(band.figures, parameters, spread)
    relative = np.abs(band.error(parameters) / band.response)
    low, high = (float(edge / (2.0 * np.pi)) for edge in used.omega[[0, -1]])
    return RationalFit(
        model=_model(parameters, band),
        gain_ratio=ratio,
        misfit=float(np.sqrt(np.mean(relative**2))),
        band=(low, high),
        resonance=frequency,
        damping=damping,
        resonance_interval=intervals[0],
        damping_interval=intervals[1],
        gain_interval=intervals[2],
        noise_share=used.noise_share,
        nonlinearity_share=used.nonlinearity_share,
        warnings=response_findings(used, frequency, damping),
    )


def _model(parameters: Array, band: Band) -> VibrationModel:
    """Return the polynomials in s of rad/s, the gain at rest set to the gauge."""
    numerator, denominator = polynomials(parameters, band.order)
    scale = band.unit ** np.arange(band.order.poles + 1)
    numerator = band.gauge / parameters[-1] * numerator * scale[-len(numerator) :]
    return VibrationModel(
        numerator=tuple(float(b) for b in numerator),
        denominator=tuple(float(a) for a in denominator * scale),
    )
