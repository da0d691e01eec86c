"""How late a frequency record is, beyond what the scanner's own poles delay.

A rational model takes a delay in silence: three zeros bend into the phase of 20 µs up to 800 Hz
within 10⁻⁴ of the response. It is seen only by a model that has no zeros to spare. The minimal one
is that of modal analysis (D. J. Ewins, Modal Testing, 2000): poles without zeros, and beside them
the compliance of one mode beyond the band,

    G(s) = (g / d(s) + r ω² / (s² + 2 ζ ω s + ω²)) e^{-sτ},

seen behind the converter's hold. Assumption: the scanner itself has no zeros of its own but these.
"""

import numpy as np
from attrs import evolve, frozen
from scipy.optimize import least_squares

from afm_scan_ros.core.errors import ScanError
from afm_scan_ros.core.identification.vibration.line_response import FrequencyResponse
from afm_scan_ros.core.identification.vibration.rational_fit import (
    LINES_PER_POLE,
    Band,
    Complex,
    Order,
    held_response,
    polynomials,
    search_bounds,
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
EDGE = 1e-9
"""Relative, for a band's own last line to lie within."""
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
    bands = [measured.up_to(limit * (1.0 + EDGE)) for limit in (highest, NARROWER * highest)]
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
