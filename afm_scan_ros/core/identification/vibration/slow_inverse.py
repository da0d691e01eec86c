"""The effective input F behind a slow displacement: what the vibration takes from it is put back.

The optimal inverse of Croft, Shed and Devasia (2001), Eq. 22, with R/Q = (f / f_c)⁶, over the whole
record at once in the frequency domain. The corner f_c lies just below the resonance: ramps are
slow, and what is faster is noise. No impulse response is cut off, so the inverse exists whatever
the model's poles and zeros are.
"""

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft, rfftfreq

from afm_scan_ros.core.effects.optimal_inverse import SmoothWeight
from afm_scan_ros.core.identification.vibration.rational_fit import held_response, resonance
from afm_scan_ros.core.model import VibrationModel
from afm_scan_ros.core.types import Array

CORNER = 0.88
"""Of f_c, over the resonance."""
STEEPNESS = 3
"""Half of the power with which R/Q grows."""
PASSED = 10.0
"""Times the corner up to which anything passes: beyond, R/Q is above 10⁶."""
RETURN = 30.0
"""Periods of the corner in which the padded record returns to where it began."""
RAMP = 10.0
"""Periods of the corner that a ramp across the range must last: within three, loops widen by 2 %"""


def corner(peak: float) -> float:
    """Frequency f_c (Hz) for a highest peak (Hz)."""
    return CORNER * peak


def shortest_ramp(peak: float) -> float:
    """Seconds that a ramp across the range must last at a highest peak (Hz)."""
    return RAMP / corner(peak)


def slow_input(model: VibrationModel, displacement: Array, sample_period: float) -> Array:
    """Return F (V), (n,), of a displacement (m), (n,), below the model's highest peak."""
    count, limit = len(displacement), corner(_highest_peak(model))
    back = int(np.ceil(RETURN / (limit * sample_period)))
    size = next_fast_len(count + back, real=True)
    turn = 0.5 + 0.5 * np.cos(np.linspace(0.0, np.pi, size - count + 2)[1:-1])
    first, last = displacement[0], displacement[-1]
    spectrum = rfft(np.concatenate([displacement, first + (last - first) * turn]))
    frequency = rfftfreq(size, sample_period)
    passed = int(np.searchsorted(frequency, PASSED * limit))
    omega = 2.0 * np.pi * frequency[1:passed]
    gain = _response(model, omega, sample_period)
    weight = SmoothWeight(limit, STEEPNESS).ratio(omega, sample_period) * model.static_gain**2
    spectrum[0] /= model.static_gain
    spectrum[1:passed] *= gain.conj() / (np.abs(gain) ** 2 + weight)
    spectrum[passed:] = 0.0
    return np.asarray(irfft(spectrum, size)[:count])


def _highest_peak(model: VibrationModel) -> float:
    """Frequency (Hz) of the pole with the highest peak."""
    unit = float(np.abs(np.roots(model.denominator)).max())
    numerator, denominator = _scaled(model, unit)
    return resonance(numerator, denominator)[0] * unit / (2.0 * np.pi)


def _scaled(model: VibrationModel, unit: float) -> tuple[Array, Array]:
    """Polynomials in s over a unit (rad/s)."""
    powers = unit ** np.arange(len(model.denominator) - 1, -1.0, -1.0)
    numerator = np.array(model.numerator) * powers[-len(model.numerator) :]
    return numerator / powers[0], np.array(model.denominator) * powers / powers[0]


def _response(model: VibrationModel, omega: Array, sample_period: float) -> Array:
    """Held response at angular frequencies (rad/s), in units of time near the poles' own."""
    order = len(model.denominator) - 1
    unit = abs(model.denominator[-1] / model.denominator[0]) ** (1.0 / order)
    held = held_response(*_scaled(model, unit), omega / unit, sample_period * unit)
    return np.asarray(held * np.exp(-1j * omega * model.delay))
