"""Structure of the vibration model: the number of poles and zeros, and the delay of the record.

Criterion: G. Schwarz, Estimating the dimension of a model, Ann. Statist. 6, 461 (1978), with a
quasi-likelihood, χ²/c + p ln 2n for p numbers fitted to n complex lines. χ² is that of the lines'
scatter and of the relative error that any model of few modes is expected to have. The dispersion c
is χ² per degree of freedom of the best model tried, and at least 1 (K. P. Burnham and D. R.
Anderson, Model Selection and Multimodel Inference, 2nd ed., 2002, section 2.5): what no model
explains is no reason for a larger one.

Poles are added until the scatter explains the residual. Zeros are then taken away. A model counts
only if the record identifies each of its modes: of one beyond the band the lines show the
compliance and neither frequency nor damping, and no inverse should be made of these.

A rational model takes a delay in silence: three zeros bend into the phase of 20 µs up to 800 Hz
within 10⁻⁴ of the response. It is seen only by a model that has no zeros to spare. The minimal one
is that of modal analysis (D. J. Ewins, Modal Testing, 2000): poles without zeros, and beside them
the compliance of one mode beyond the band,

    G(s) = (g / d(s) + r ω² / (s² + 2 ζ ω s + ω²)) e^{-sτ},

seen behind the converter's hold. Assumption: the scanner itself has no zeros of its own but these.
"""

from collections.abc import Iterator

import numpy as np
from attrs import evolve, field, frozen
from scipy.optimize import least_squares

from afm_scan_ros.core.errors import ScanError
from afm_scan_ros.core.identification.vibration.line_response import EDGE, FrequencyResponse
from afm_scan_ros.core.identification.vibration.rational_fit import (
    DAMPINGS,
    LINES_PER_POLE,
    RESONANT,
    Band,
    Complex,
    Order,
    RationalFit,
    fit_rational,
    held_response,
    polynomials,
    search,
    search_bounds,
    slowest,
    starts,
)
from afm_scan_ros.core.least_squares import (
    Interval,
    intervals_95,
    require_converged,
    sandwich,
    slopes,
)
from afm_scan_ros.core.types import Array

POLES = (1, 2, 3, 4, 5, 6, 8, 10, 12)
UNDAMPED = 2.0 * DAMPINGS[0]
"""Damping ratio below which a mode has merely run into the search's bound."""
ENOUGH = 3.0
"""Standard deviations of χ² by which it may exceed its degrees of freedom and be explained."""
CLEAR, FEWEST = 2.0, 3
"""Deviations by which a mode shows in a line, and lines in which it does at least."""
ADDED = 0.01
"""Damping ratio that an added mode begins with."""

REAL = 1.2
"""Damping ratio that two real poles begin with: of equal ones the residues are infinite."""


@frozen
class OrderTrial:
    """One order, and how well the best model of it fits ``lines`` lines."""

    order: Order
    lines: int
    chi_squared: float
    misfit: float
    """Rms relative error."""
    determined: bool
    """Whether the record shows each of its modes."""
    shape: Array = field(eq=False)
    """Numbers of its denominator, (order.poles,), as the search has them."""

    @property
    def freedom(self) -> int:
        """Degrees of freedom of the residual."""
        return 2 * self.lines - self.order.parameters

    @property
    def explained(self) -> bool:
        """Whether the scatter explains the residual."""
        return self.chi_squared <= self.freedom + ENOUGH * float(np.sqrt(2.0 * self.freedom))

    def criterion(self, dispersion: float) -> float:
        """Schwarz's criterion: the smaller, the better."""
        cost = self.order.parameters * np.log(2.0 * self.lines)
        return float(self.chi_squared / dispersion + cost)


@frozen
class OrderChoice:
    """Every order tried, and the one that the criterion chooses."""

    trials: tuple[OrderTrial, ...]

    @property
    def dispersion(self) -> float:
        """χ² per degree of freedom of the best model, at least 1."""
        return max(1.0, min(trial.chi_squared / trial.freedom for trial in self.trials))

    @property
    def best(self) -> OrderTrial:
        """The trial chosen; of them all where the record identifies the modes of none."""
        determined = [trial for trial in self.trials if trial.determined] or list(self.trials)
        return min(determined, key=lambda trial: trial.criterion(self.dispersion))

    @property
    def chosen(self) -> Order:
        """Its order."""
        return self.best.order

    def narrowing(self) -> "Iterator[OrderChoice]":
        """Yield the choice, then that among the orders of fewer poles, and so on."""
        yield self
        fewer = tuple(t for t in self.trials if t.order.poles < self.chosen.poles)
        if fewer:
            yield from OrderChoice(fewer).narrowing()


def choose_order(measured: FrequencyResponse, sample_period: float, gauge: float) -> OrderChoice:
    """Try orders on a response (m/V) to all of its lines; ``gauge`` in m/V as in ``fit_rational``.

    Raises InputError where there are too few lines for any.
    """
    trials: list[OrderTrial] = []
    for poles in POLES:
        if trials and (len(measured.omega) < LINES_PER_POLE * poles or trials[-1].explained):
            break
        band = Band.of(measured, sample_period, gauge, Order(poles, poles - 1))
        trials.append(_trial(band, [_grown(each, band) for each in trials[-2:]]))
    grown = OrderChoice(tuple(trials))
    return OrderChoice((*trials, *_fewer_zeros(grown, measured, sample_period, gauge)))


def fit_chosen(measured: FrequencyResponse, sample_period: float, gauge: float) -> RationalFit:
    """Fit a model of the order that the response chooses, as ``fit_rational`` does."""
    best = choose_order(measured, sample_period, gauge).best
    return fit_rational(measured, sample_period, gauge, best.order, [best.shape])


def _trial(band: Band, further: list[Array]) -> OrderTrial:
    suggested = starts(band.omega, band.response, band.order, band.period)
    parameters = search(band, [*further, *suggested])
    error = band.error(parameters)
    return OrderTrial(
        band.order,
        len(band.omega),
        chi_squared=float(2.0 * np.sum(band.weighed(error) ** 2)),
        misfit=float(np.sqrt(np.mean(np.abs(error / band.response) ** 2))),
        determined=_determined(parameters, band),
        shape=parameters[: band.order.poles],
    )


def _grown(smaller: OrderTrial, band: Band) -> Array:
    """Start of a search: the poles of a smaller model, and further ones where it misses most."""
    missed = evolve(band, order=smaller.order).projected(smaller.shape).reshape(2, -1)
    where = np.log(band.omega[np.argmax(np.sum(missed**2, axis=0))])
    pairs = smaller.shape[: smaller.order.poles // 2 * 2]
    real = smaller.shape[len(pairs) :]
    added = band.order.poles - smaller.order.poles
    pair = np.array([where, np.log(ADDED)])
    if added == 1 and len(real):  # two real poles make a pair
        return np.concatenate([pairs, [(real[0] + where) / 2.0, np.log(REAL)]])
    return np.concatenate([pairs, np.tile(pair, added // 2), real, [where] * (added % 2)])


def _fewer_zeros(
    grown: OrderChoice, measured: FrequencyResponse, sample_period: float, gauge: float
) -> Iterator[OrderTrial]:
    """Try the best number of poles with fewer and fewer zeros, while that is no worse."""
    best = grown.best
    before = best
    for zeros in range(best.order.zeros - 1, -1, -1):
        band = Band.of(measured, sample_period, gauge, Order(best.order.poles, zeros))
        trial = _trial(band, [before.shape])
        yield trial
        if trial.criterion(grown.dispersion) > before.criterion(grown.dispersion):
            return
        before = trial


def _gain_determined(parameters: Array, band: Band) -> bool:
    """Whether the gain at rest is known from none: slow poles and zeros may make it anything."""
    along = slopes(band.residual, parameters)
    covariance = sandwich(along, band.spread(band.error(parameters), along))
    return bool(parameters[-1] > CLEAR * np.sqrt(covariance[-1, -1]))


def _determined(parameters: Array, band: Band) -> bool:
    """Whether the lines show each resonant mode: inside the band, damped, in more than one line."""
    shape = parameters[: band.order.poles]
    numerator, denominator = polynomials(parameters, band.order)
    below = slowest(numerator, denominator) < band.omega[0]
    if below or not _gain_determined(parameters, band):
        return False
    pairs = np.exp(shape[: len(shape) // 2 * 2].reshape(-1, 2))
    for frequency, damping in pairs[pairs[:, 1] < RESONANT]:
        inside = band.omega[0] <= frequency <= band.omega[-1] * (1.0 + EDGE)
        pole = frequency * (-damping + 1j * np.sqrt(1.0 - damping**2))
        residue = np.polyval(numerator, pole) / np.polyval(np.polyder(denominator), pole)
        size = np.linalg.norm(
            band.weighed(residue / (1j * band.omega - pole)).reshape(2, -1), axis=0
        )
        if not (inside and damping > UNDAMPED and np.sum(size > CLEAR) >= FEWEST):
            return False
    return True


MINIMAL = Order(poles=4, zeros=0)
BEYOND = np.log([1.05, 1.8, 4.0])
"""Least, first and greatest ln ω of the mode beyond, over the band's end."""
DAMPING = 0.005
"""ζ of the mode beyond: from so far it hardly shows."""
DELAYS = (-5.0, 50.0)
"""Range of delays sought, in radians of the highest line."""
REACH = 1.77
"""Times the resonance up to which lines count: beyond it the mode beyond is no compliance."""
UNIDENTIFIED = (-np.inf, np.inf)
NARROWER = 0.8
"""Share of the band that must give the same delay."""
LOW = 0.2
"""Share of the band from whose phase the search begins."""


@frozen
class RecordDelay:
    """Delay of displacement after drive in s, with the interval that two bands give together."""

    delay: float
    interval: Interval
    misfit: float
    """Rms residual of the minimal model, relative to the response."""


def record_delay(
    measured: FrequencyResponse, sample_period: float, resonance: float
) -> RecordDelay:
    """Find the delay of a response (m/V) from its lines about a resonance (Hz), and from fewer.

    Where there are too few of them, or they are so noisy that no search ends, nothing is known.
    """
    highest = min(REACH * resonance, float(measured.frequency[-1]))
    bands = [measured.up_to(limit) for limit in (highest, NARROWER * highest)]
    if min(len(band.omega) for band in bands) < LINES_PER_POLE * MINIMAL.poles:
        return RecordDelay(0.0, UNIDENTIFIED, np.inf)
    try:
        whole, part = (_fit(band, sample_period) for band in bands)
    except ScanError:
        return RecordDelay(0.0, UNIDENTIFIED, np.inf)
    ends = np.array([whole.interval, part.interval])
    return evolve(whole, interval=(float(ends[:, 0].min()), float(ends[:, 1].max())))


@frozen(eq=False)
class _Minimal:
    """The minimal model on the lines of a band.

    What is searched is ln ω and ln ζ of each pair of poles, ln ω of the mode beyond and the
    delay; both gains follow. Frequencies and delay are in units of the highest line.
    """

    band: Band

    def shares(self, shape: Array) -> Complex:
        """Responses of the poles and of the mode beyond at gain 1, (lines, 2)."""
        omega, beyond = self.band.omega, np.exp(shape[-2])
        structure = polynomials(np.append(shape[: MINIMAL.poles], 1.0), MINIMAL)
        mode = np.array([beyond**2]), np.array([1.0, 2.0 * DAMPING * beyond, beyond**2])
        held = [
            held_response(numerator, denominator, omega, self.band.period)
            for numerator, denominator in (structure, mode)
        ]
        late: Complex = np.exp(-1j * omega * shape[-1])
        return np.column_stack([late * each for each in held])

    def gains(self, shape: Array) -> Array:
        """Best gains, (2,): linear least squares."""
        system = np.column_stack([self.band.weighed(share) for share in self.shares(shape).T])
        target = self.band.weighed(self.band.response)
        return np.asarray(np.linalg.lstsq(system, target, rcond=None)[0])

    def error(self, parameters: Array) -> Complex:
        """Model less measurement, (lines,), of a shape and its gains."""
        return self.shares(parameters[:-2]) @ parameters[-2:] - self.band.response

    def residual(self, parameters: Array) -> Array:
        """Error as least squares counts it."""
        return self.band.weighed(self.error(parameters))

    def projected(self, shape: Array) -> Array:
        """Residual of a shape with its best gains."""
        return self.residual(np.concatenate([shape, self.gains(shape)]))


def _fit(used: FrequencyResponse, sample_period: float) -> RecordDelay:
    band = Band.of(used, sample_period, float(np.abs(used.response[0])), MINIMAL)
    minimal, (low, high) = _Minimal(band), search_bounds(MINIMAL, band.omega)
    earliest, latest = DELAYS
    bounds = np.append(low, [BEYOND[0], earliest]), np.append(high, [BEYOND[2], latest])
    ends = [
        least_squares(minimal.projected, start, bounds=bounds, x_scale="jac", max_nfev=200)
        for start in _starts(band)
    ]
    shape = require_converged(min(ends, key=lambda end: float(end.cost)), "delay")
    parameters = np.concatenate([shape, minimal.gains(shape)])
    along = slopes(minimal.residual, parameters)
    covariance = sandwich(along, band.spread(minimal.error(parameters), along))
    interval = intervals_95(lambda every: every[[-3]] / band.unit, parameters, covariance)[0]
    relative = np.abs(minimal.error(parameters) / band.response)
    misfit = float(np.sqrt(np.mean(relative**2)))
    return RecordDelay(float(shape[-1] / band.unit), interval, misfit)


def _starts(band: Band) -> list[Array]:
    """Shapes to begin from: on time, and as late as the phase at low frequencies falls.

    Of that fall the poles' own share, the sum of 2 ζ / ω, is left to them.
    """
    low = band.omega <= LOW
    slope = np.polyfit(band.omega[low], np.unwrap(np.angle(band.response[low])), 1)[0]
    found = []
    for fall in (0.0, max(-float(slope), 0.0)):
        response = band.response * np.exp(1j * band.omega * fall)
        for shape in starts(band.omega, response, MINIMAL, band.period):
            own = float(np.sum(2.0 * np.exp(shape[1::2] - shape[::2])))
            found.append(np.append(shape, [BEYOND[1], max(fall - own, 0.0)]))
    return found
