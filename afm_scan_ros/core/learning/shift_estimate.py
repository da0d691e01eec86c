"""Recursive least squares for a shift, with two uncertainties: the model's error and the noise.

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
"""

from typing import Self

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from afm_scan_ros.core.bands import bounds, coefficients
from afm_scan_ros.core.diagnosis.discrepancy import DetectionLimit
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.learning.axis_shift import room
from afm_scan_ros.core.learning.line_signals import HYSTERESIS, UNKNOWNS, LineSignals
from afm_scan_ros.core.types import Array

ROOM = np.append(room()[:HYSTERESIS], 1.0)
"""Distance of each unknown from 0 to its nearest bound, (4,)."""


@frozen(eq=False)
class Information:
    """Weighted sums over lines: of their number, Z'A, Z't, Z'Z, and the noise's covariance of Z't.

    Z are the instruments, A the parts and t the residual, in units of the detection limit.
    """

    lines: float
    normal: Array
    moment: Array
    own: Array
    noise: Array

    @classmethod
    def nothing(cls) -> Self:
        """No line was seen."""
        square = np.zeros((UNKNOWNS, UNKNOWNS))
        return cls(0.0, square, np.zeros(UNKNOWNS), square, square)

    def after(self, line: "Information", kept: float) -> "Information":
        """Return the sums after one more line, with the share ``kept`` of those before."""
        return Information(
            kept * self.lines + line.lines,
            kept * self.normal + line.normal,
            kept * self.moment + line.moment,
            kept * self.own + line.own,
            kept**2 * self.noise + line.noise,
        )


@frozen(eq=False)
class Estimate:
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
            1.0, weighted @ parts.T, weighted @ residual, weighted @ instruments.T, noise
        )


def estimate(known: Information, held: Array, deviations: float) -> Estimate:
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
    return Estimate(*(np.where(linear, first, second) for first, second in pairs))


def _excited(
    known: Information, held: Array, deviations: float, wanted: NDArray[np.bool_]
) -> Estimate:
    """Estimate those of the ``wanted`` unknowns that are excited, (4,)."""
    free = wanted.copy()
    while True:
        found = _solved(known, held, free)
        share = np.where(free, deviations * found.model_error / ROOM, 0.0)
        if share.max() <= 1.0:
            return found
        free[np.argmax(share)] = False


def _solved(known: Information, held: Array, free: NDArray[np.bool_]) -> Estimate:
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
    return Estimate(unknowns, model_error, noise, free.copy())


def _deviations(inverse: Array, covariance: Array) -> Array:
    return np.asarray(np.sqrt(np.diag(inverse @ covariance @ inverse.T)))
