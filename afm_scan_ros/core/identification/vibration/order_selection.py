"""How many poles and zeros a record supports, by likelihood against what each number costs.

Criterion: G. Schwarz, Estimating the dimension of a model, Ann. Statist. 6, 461 (1978), with a
quasi-likelihood, χ²/c + p ln 2n for p numbers fitted to n complex lines. χ² is that of the lines'
scatter and of the relative error that any model of few modes is expected to have. The dispersion c
is χ² per degree of freedom of the best model tried, and at least 1 (K. P. Burnham and D. R.
Anderson, Model Selection and Multimodel Inference, 2nd ed., 2002, section 2.5): what no model
explains is no reason for a larger one.

Poles are added until the scatter explains the residual. Zeros are then taken away. A model counts
only if the record identifies each of its modes: of one beyond the band the lines show the
compliance and neither frequency nor damping, and no inverse should be made of these.
"""

from collections.abc import Iterator

import numpy as np
from attrs import field, frozen

from afm_scan_ros.core.identification.vibration.line_response import FrequencyResponse
from afm_scan_ros.core.identification.vibration.rational_fit import (
    DAMPINGS,
    LINES_PER_POLE,
    RESONANT,
    Band,
    Order,
    RationalFit,
    fit_rational,
    polynomials,
    search,
    slowest,
    starts,
)
from afm_scan_ros.core.least_squares import sandwich, slopes
from afm_scan_ros.core.types import Array

POLES = (1, 2, 3, 4, 5, 6, 8, 10, 12)
UNDAMPED = 2.0 * DAMPINGS[0]
"""Damping ratio below which a mode has merely run into the search's bound."""
EDGE = 1e-9
"""Relative, for the band's own last line to lie within."""
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
    fewer = Band(
        band.omega,
        band.response,
        band.deviation,
        band.period,
        band.unit,
        band.gauge,
        smaller.order,
    )
    missed = fewer.projected(smaller.shape).reshape(2, -1)
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
