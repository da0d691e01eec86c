"""Creep by relative gains and time constants."""

import numpy as np

from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.axis_spec import RationalSpec
from afm_scan_ros.simulation.dynamics import fractions


def series(creep: RationalSpec) -> tuple[Array, Array]:
    """Gains g (1) and time constants tau (s) of d + sum g / (1 + s tau), slowest first."""
    poles, residues = (part.real for part in fractions(creep))
    order = np.argsort(-poles)
    return (-residues / poles)[order], (-1.0 / poles)[order]


def with_series(creep: RationalSpec, gains: Array, taus: Array) -> RationalSpec:
    """Creep that moves at once as ``creep`` does, and then with these gains and constants."""
    poles = -1.0 / taus
    numerator = np.poly(poles) * (creep.numerator[0] / creep.denominator[0])
    for i, (gain, pole) in enumerate(zip(gains, poles, strict=True)):
        numerator[1:] -= gain * pole * np.poly(np.delete(poles, i))
    return RationalSpec(tuple(numerator.tolist()), tuple(np.poly(poles).tolist()))
