"""Creep of both axes as Croft, Shed and Devasia (2001) publish it."""

from scipy.signal import residue

from afm_scan_ros.core.effects.creep import CreepModel


def _series(numerator: tuple[float, ...], denominator: tuple[float, ...]) -> CreepModel:
    """Springs and dampers of polynomials in descending powers of s, slowest last."""
    residues, poles, direct = residue(numerator, denominator)
    order = poles.real.argsort()
    gains = -residues.real / (poles.real * direct[0])
    return CreepModel(tuple(gains[order]), tuple(-1.0 / poles.real[order]))


CREEP_X = _series((1.0, 0.630, 0.0216, 6.25e-5), (1.0, 0.516, 0.0171, 4.69e-5))
"""Eq. 6."""

CREEP_Y = _series((1.0, 0.589, 0.0233, 1.48e-5), (1.0, 0.517, 0.0197, 1.14e-5))
"""Eq. 9."""
