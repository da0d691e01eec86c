"""A scanner whose resonance is not where its model's is."""

import numpy as np
from attrs import evolve

from afm_scan_ros.simulation.spec import PlantSpec, RationalSpec


def detuned(spec: PlantSpec, frequency: float, damping: float) -> PlantSpec:
    """Plant whose first resonance has its frequency and damping ratio times these factors.

    In both axes; the static gain, the other poles and the zeros stay. The first resonance is the
    least damped pair of the polynomials' poles. Raises InputError where it would be unstable.
    """
    x, y = (
        evolve(axis, vibration=_moved(axis.vibration, frequency, damping))
        for axis in (spec.x, spec.y)
    )
    return evolve(spec, x=x, y=y)


def _moved(vibration: RationalSpec, frequency: float, damping: float) -> RationalSpec:
    poles = np.roots(vibration.denominator)
    first = poles[np.argmin(-poles.real / np.abs(poles))]
    pair = np.isclose(poles, first) | np.isclose(poles, first.conj())
    natural = np.abs(first) * frequency
    ratio = -first.real / np.abs(first) * damping
    poles[pair] = np.roots([1.0, 2.0 * ratio * natural, natural**2])
    denominator = vibration.denominator[0] * np.poly(poles).real
    scale = denominator[-1] / vibration.denominator[-1]
    numerator = scale * np.array(vibration.numerator)
    return RationalSpec(tuple(numerator.tolist()), tuple(denominator.tolist()))
