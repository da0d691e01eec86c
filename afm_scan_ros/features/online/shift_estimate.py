"""Estimates of a shift from line to line: recursive least squares, and slow creep from means.

Line by line, the residual's cosine coefficients are regressed on the unknowns' parts, each
coefficient weighted by the detection limit (diagnosis/discrepancy.py). Lines are forgotten
exponentially (L. Ljung, System Identification, 2nd ed. 1999, section 11.2). For constant
excitation this is a Kalman filter whose unknowns walk at random, by 1/memory of a line's standard
deviation from line to line.

- The sensor's noise differs from line to line, and averages out.
- The model's error is the same on every line of the same path, and does not. It is taken as drawn
  once, with the detection limit as its rms.

An unknown's prior has its nearest bound as standard deviation. So an unknown that a scan does not
excite keeps that uncertainty.

The mean residual of line L is a constant + (g - 1) ŷ + c z, with the line's means of ŷ and z. Lines
are forgotten with the creep's own time constant. What is left must be within the detection limit
below half the line rate: else the motion is a drift, and not this creep.
"""

from math import exp
from typing import Self

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from afm_scan_ros.core.bands import bounds, coefficients
from afm_scan_ros.core.diagnosis.discrepancy import DetectionLimit
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import Array
from afm_scan_ros.features.online.adapted_reference import room
from afm_scan_ros.features.online.line_signals import GAIN, HYSTERESIS, UNKNOWNS, LineSignals

ROOM = np.append(room()[:HYSTERESIS], 1.0)
"""Distance of each unknown from 0 to its nearest bound, (4,)."""


@frozen(eq=False)
class Information:
    """Weighted sums over lines: of their number, Z'A, Z't, Z'Z, and the noise's covariance of Z't.

    Z are the instruments, A the parts and t the residual, in units of the detection limit.
    ``products`` (5, 5) are those of (t, A), as means over a line's coefficients.
    """

    lines: float
    normal: Array
    moment: Array
    own: Array
    noise: Array
    products: Array

    @classmethod
    def nothing(cls) -> Self:
        """No line was seen."""
        square = np.zeros((UNKNOWNS, UNKNOWNS))
        return cls(0.0, square, np.zeros(UNKNOWNS), square, square, np.zeros((UNKNOWNS + 1,) * 2))

    def after(self, line: "Information", kept: float) -> "Information":
        """Return the sums after one more line, with the share ``kept`` of those before."""
        return Information(
            kept * self.lines + line.lines,
            kept * self.normal + line.normal,
            kept * self.moment + line.moment,
            kept * self.own + line.own,
            kept**2 * self.noise + line.noise,
            kept * self.products + line.products,
        )

    def left(self, unknowns: Array) -> float:
        """Rms of what unknowns (4,) leave of the residual, over the detection limit."""
        taken = np.append(1.0, -unknowns)
        return float(np.sqrt(taken @ self.products @ taken / max(self.lines, 1.0)))


@frozen(eq=False)
class ShiftEstimate:
    """Unknowns (4,) with standard deviations by the model's error and by noise, (4,).

    An unknown that is not ``excited``, (4,), was held at a given value. The hysteresis' η is
    estimated beside the others, which are estimated as if it had not changed.
    """

    unknowns: Array
    model_error: Array
    noise: Array
    excited: NDArray[np.bool_]


class LineInformation:
    """Information of one line under a detection limit; raises InputError where that is zero."""

    def __init__(self, limit: DetectionLimit, samples: int, sample_period: float) -> None:
        count = np.diff(bounds(limit.edges, samples, sample_period))
        self._limit = np.repeat(limit.rms**2 / np.maximum(count, 1), count)
        self._noise = np.repeat(limit.noise**2 / np.maximum(count, 1), count)
        if not np.all(self._limit > 0.0):
            raise InputError(
                "the model states neither noise nor error in some band, so no change is too small"
                " to be seen: identify it anew, with its validation record"
            )

    def of(self, line: LineSignals) -> Information:
        """Return the information of a line."""
        rows = np.concatenate((line.residual[None], line.parts, line.instruments))
        found = coefficients(rows)
        residual, parts, instruments = found[0], found[1 : 1 + UNKNOWNS], found[1 + UNKNOWNS :]
        weighted = instruments / self._limit
        noise = (weighted * self._noise) @ weighted.T
        return Information(
            1.0,
            weighted @ parts.T,
            weighted @ residual,
            weighted @ instruments.T,
            noise,
            (found[: 1 + UNKNOWNS] / self._limit) @ found[: 1 + UNKNOWNS].T / len(self._limit),
        )


def estimate(known: Information, held: Array, deviations: float) -> ShiftEstimate:
    """Estimate the unknowns; those that are not excited keep their ``held`` values (4,).

    An unknown is excited where so many standard ``deviations`` by the model's error are within its
    room: else no value within the bounds could be detected.
    """
    linear = np.arange(UNKNOWNS) != HYSTERESIS
    one = _excited(known, held, deviations, linear)
    both = _excited(known, held, deviations, one.excited | ~linear)
    pairs = (
        (getattr(one, name), getattr(both, name))
        for name in ("unknowns", "model_error", "noise", "excited")
    )
    return ShiftEstimate(*(np.where(linear, first, second) for first, second in pairs))


def _excited(
    known: Information, held: Array, deviations: float, wanted: NDArray[np.bool_]
) -> ShiftEstimate:
    """Estimate those of the ``wanted`` unknowns that are excited, (4,)."""
    free = wanted.copy()
    while True:
        found = _solved(known, held, free)
        share = np.where(free, deviations * found.model_error / ROOM, 0.0)
        if share.max() <= 1.0:
            return found
        free[np.argmax(share)] = False


def _solved(known: Information, held: Array, free: NDArray[np.bool_]) -> ShiftEstimate:
    prior = max(known.lines, 1.0) * np.diag(ROOM**-2.0)
    unknowns, model_error, noise = held.copy(), ROOM.copy(), np.zeros(UNKNOWNS)
    if free.any():
        each = np.ix_(free, free)
        inverse: Array = np.linalg.inv((known.normal + prior)[each]).astype(np.float64)
        across = known.normal[np.ix_(free, ~free)] @ held[~free]
        unknowns[free] = inverse @ (known.moment[free] - across)
        coherent = max(known.lines, 1.0) * (known.own + prior)
        model_error[free] = _deviations(inverse, coherent[each])
        noise[free] = _deviations(inverse, known.noise[each])
    return ShiftEstimate(unknowns, model_error, noise, free.copy())


def _deviations(inverse: Array, covariance: Array) -> Array:
    return np.asarray(np.sqrt(np.diag(inverse @ covariance @ inverse.T)))


CREEP_ROOM = room()[[3, 0]]
"""Of c and g - 1."""


@frozen
class CreepEstimate:
    """c, its standard deviation by the model's error, and the rms (m) that it leaves."""

    change: float
    model_error: float
    left: float


class CreepInformation:
    """Sums over lines of products of (1, z, ŷ, residual), shape (4, 4); the state is passed in."""

    def __init__(self, limit: DetectionLimit, time_constant: float, line_rate: float) -> None:
        slow = np.array(limit.edges[:-1]) < 0.5 * line_rate
        self.limit = float(np.linalg.norm(limit.rms[slow]))
        self._kept = exp(-1.0 / (time_constant * line_rate))

    def at_rest(self) -> Array:
        """No line was seen."""
        return np.zeros((4, 4))

    def after(self, before: Array, line: LineSignals) -> Array:
        """Return the sums after one more line."""
        predicted = line.parts[GAIN]
        means = np.array([1.0, line.creep.mean(), predicted.mean(), line.residual.mean()])
        return np.asarray(self._kept * before + np.outer(means, means))

    def estimate(self, sums: Array) -> CreepEstimate:
        """Estimate c; without any line, with the prior's deviation."""
        mean = sums[0, 1:] / max(sums[0, 0], 1.0)
        products = (sums[1:, 1:] / max(sums[0, 0], 1.0) - np.outer(mean, mean)) / self.limit**2
        covariance = np.linalg.inv(products[:2, :2] + np.diag(CREEP_ROOM**-2.0))
        unknowns = covariance @ products[:2, 2]
        explained = unknowns @ (2.0 * products[:2, 2] - products[:2, :2] @ unknowns)
        left = self.limit * float(np.sqrt(max(products[2, 2] - explained, 0.0)))
        return CreepEstimate(float(unknowns[0]), float(np.sqrt(covariance[0, 0])), left)
