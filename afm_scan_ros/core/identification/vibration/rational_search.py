"""The search for the rational function that a frequency response is most likely to be of.

The poles are searched, from several starts; for each choice of them the numerator follows by
linear least squares (variable projection).
"""

import numpy as np
from attrs import frozen
from scipy.optimize import least_squares

from afm_scan_ros.core.identification.vibration.line_response import FrequencyResponse
from afm_scan_ros.core.identification.vibration.rational_form import (
    Complex,
    Order,
    held_response,
    polynomials,
    resonance,
)
from afm_scan_ros.core.identification.vibration.rational_starts import search_bounds, starts
from afm_scan_ros.core.types import Array

EXPECTED = 1e-3
"""Relative error expected of so short a model of a scanner that has more modes."""
EVENLY = np.exp(0.25j * np.pi)
"""1 turned so that its real and imaginary parts are alike."""


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

    def numerator(self, shape: Array) -> Array:
        """Best numerator for a denominator's numbers: linear least squares."""
        count = self.order.zeros + 1
        denominator = polynomials(np.concatenate([shape, np.zeros(count)]), self.order)[1]
        columns = held_response(
            denominator[-1] * np.eye(count), denominator, self.omega, self.period
        )
        system = self.weighed(columns).T
        return np.asarray(np.linalg.lstsq(system, self.weighed(self.response), rcond=None)[0])

    def projected(self, shape: Array) -> Array:
        """Residual of a denominator's numbers with the best numerator: fewer to search over."""
        return self.residual(np.concatenate([shape, self.numerator(shape)]))

    def spread(self, error: Complex, parameters: int) -> Array:
        """Standard deviation of the residual; where the model misses more than that, of the miss.

        ``error`` is what so many ``parameters`` leave. Half of a line's variance lies in the real
        part and half in the imaginary.
        """
        known = np.maximum(self.deviation, np.finfo(float).eps * np.abs(self.response))
        spare = len(self.omega) - parameters / 2.0
        excess = float(np.sum((np.abs(error) / known) ** 2)) / spare
        return np.asarray(max(excess, 1.0) ** 0.5 * self.weighed(known * EVENLY))

    def figures(self, parameters: Array) -> Array:
        """Resonance (Hz), damping ratio and gain over the gauge."""
        frequency, damping = resonance(*polynomials(parameters, self.order))
        return np.array([frequency * self.unit / (2.0 * np.pi), damping, parameters[-1]])


def search(band: Band) -> Array:
    """Most likely parameters, (order.parameters,), of all that the starts lead to."""
    begin = starts(band.omega, band.response, band.order, band.period)
    bounds = search_bounds(band.order)
    ends = [
        least_squares(band.projected, start, bounds=bounds, xtol=1e-9, ftol=1e-9) for start in begin
    ]
    shape = min(ends, key=lambda end: float(end.cost)).x
    return np.concatenate([shape, band.numerator(shape)])
