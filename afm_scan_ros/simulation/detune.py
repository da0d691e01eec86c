"""An axis of the plant with another first resonance."""

import numpy as np
from attrs import evolve

from afm_scan_ros.simulation.axis_spec import AxisSpec, RationalSpec
from afm_scan_ros.simulation.dynamics import first_resonance, highest_peak


def detuned_axis(axis: AxisSpec, frequency: float, damping: float) -> AxisSpec:
    """Axis whose first resonance has its frequency and damping ratio times these factors.

    Static gain, other poles, zeros and the peaks of further modes are unchanged. The first
    resonance is the least damped pair of the polynomials' poles. Raises InputError where it would
    be unstable.
    """
    vibration = _moved(axis.vibration, frequency, damping)
    share = highest_peak(axis.vibration) / highest_peak(vibration)
    modes = tuple(evolve(mode, relative_peak=share * mode.relative_peak) for mode in axis.modes)
    return evolve(axis, vibration=vibration, modes=modes)


def _moved(vibration: RationalSpec, frequency: float, damping: float) -> RationalSpec:
    poles = np.roots(vibration.denominator)
    first = first_resonance(vibration)
    pair = np.isclose(poles, first) | np.isclose(poles, first.conjugate())
    natural = np.abs(first) * frequency
    ratio = -first.real / np.abs(first) * damping
    poles[pair] = np.roots([1.0, 2.0 * ratio * natural, natural**2])
    denominator = vibration.denominator[0] * np.poly(poles).real
    scale = denominator[-1] / vibration.denominator[-1]
    numerator = scale * np.array(vibration.numerator)
    return RationalSpec(tuple(numerator.tolist()), tuple(denominator.tolist()))
