"""Plants whose resonance or creep differs from the model's."""

import numpy as np
from attrs import evolve

from afm_scan_ros.simulation.axis_spec import AxisSpec, RationalSpec
from afm_scan_ros.simulation.dynamics import first_resonance, highest_peak
from afm_scan_ros.simulation.spec import PlantSpec


def detuned(spec: PlantSpec, frequency: float, damping: float) -> PlantSpec:
    """Plant whose first resonance has its frequency and damping ratio times these factors.

    In both axes; the static gain, the other poles, the zeros and the further modes stay. The first
    resonance is the least damped pair of the polynomials' poles. Raises InputError where it would
    be unstable.
    """
    x, y = (detuned_axis(axis, frequency, damping) for axis in (spec.x, spec.y))
    return evolve(spec, x=x, y=y)


def detuned_axis(axis: AxisSpec, frequency: float, damping: float) -> AxisSpec:
    """Axis whose first resonance is moved so.

    A further mode's peak, stated as a share of the highest, stays what it was.
    """
    vibration = _moved(axis.vibration, frequency, damping)
    share = highest_peak(axis.vibration) / highest_peak(vibration)
    modes = tuple(evolve(mode, relative_peak=share * mode.relative_peak) for mode in axis.modes)
    return evolve(axis, vibration=vibration, modes=modes)


def with_creep_rate(spec: PlantSpec, factor: float) -> PlantSpec:
    """Plant that creeps ``factor`` times as fast and as far: time constants over it, gains kept."""
    x, y = (evolve(axis, creep=_hurried(axis.creep, factor)) for axis in (spec.x, spec.y))
    return evolve(spec, x=x, y=y)


def _hurried(creep: RationalSpec, factor: float) -> RationalSpec:
    """Gc(s / factor)."""
    numerator, denominator = (
        tuple(c * factor ** (i + 1 - len(side)) for i, c in enumerate(side))
        for side in (creep.numerator, creep.denominator)
    )
    return RationalSpec(numerator, denominator)


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
