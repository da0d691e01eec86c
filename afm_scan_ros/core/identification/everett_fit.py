"""First-order reversal curves → the Everett surfaces of the hysteresis and of its inverse.

The values come straight from the record (Eq. 16), with neither differentiation nor a fit; between
curves they are interpolated, nowhere extrapolated.
"""

import numpy as np
from attrs import frozen
from scipy.interpolate import PchipInterpolator

from afm_scan_ros.core.effects.hysteresis.everett import EverettSurface
from afm_scan_ros.core.identification.reversal_curves import ReversalCurves
from afm_scan_ros.core.model import HysteresisModel
from afm_scan_ros.core.types import Array

FINE = 8
"""Points per level on which a return is read: finer than the levels, coarser than the noise."""
ON_DIAGONAL = 1e-3
"""Share of a cell within which a curve's turning point counts as lying on the diagonal."""


@frozen
class EverettFit:
    """Both surfaces; ``closure`` is by how much F (V) differs from return to return."""

    model: HysteresisModel
    closure: float

    @property
    def effective_range(self) -> float:
        """Range of F from saturation to saturation, V."""
        return self.model.forward.output_upper - self.model.forward.output_lower


def fit_everett(drive: Array, effective: Array, curves: ReversalCurves) -> EverettFit:
    """Surfaces from drive (V) and effective input F (V), both (n,), F freed of creep and vibration.

    Both have as many levels as there are curves and saturation. Raises InputError where the
    curves cross, so that there is no inverse.
    """
    fine = np.linspace(curves.levels[0], curves.levels[-1], FINE * (len(curves.levels) - 1) + 1)
    tops = effective[curves.peaks]
    bottoms = effective[curves.returned]
    returns = [
        np.interp(fine, drive[end:peak:-1], effective[end:peak:-1])
        for peak, end in zip(curves.peaks, curves.returned, strict=True)
    ]
    forward = _forward(curves.levels, tops, [curve[::FINE] for curve in returns], bottoms)
    direct = _direct(curves.levels, fine, tops, returns, bottoms)
    return EverettFit(HysteresisModel(forward=forward, direct=direct), float(np.ptp(bottoms)))


def _forward(levels: Array, tops: Array, returns: list[Array], bottoms: Array) -> EverettSurface:
    """Half of what F falls from the top of each curve to each level (Eq. 16)."""
    values = np.zeros((len(levels), len(levels)))
    for i, (top, curve) in enumerate(zip(tops, returns, strict=True), start=1):
        values[i, :i] = (top - curve[:i]) / 2.0
    return EverettSurface(levels[0], levels[-1], values, float(bottoms.mean()))


def _direct(
    levels: Array, fine: Array, tops: Array, returns: list[Array], bottoms: Array
) -> EverettSurface:
    """Half of what u falls, at equally spaced F; between curves by monotone cubics.

    Zero on the diagonal closes each column, so that the triangles there need no curve of theirs.
    """
    effective = np.linspace(bottoms.mean(), tops[-1], len(levels))
    falls = np.array(
        [
            (level - np.interp(effective, curve[: FINE * i + 1], fine[: FINE * i + 1])) / 2.0
            for i, (level, curve) in enumerate(zip(levels[1:], returns, strict=True), start=1)
        ]
    )
    values = np.zeros((len(levels), len(levels)))
    for j, beta in enumerate(effective[:-1]):
        above = tops > beta + ON_DIAGONAL * (effective[1] - effective[0])
        nodes = np.concatenate([[beta], tops[above]])
        column = PchipInterpolator(nodes, np.concatenate([[0.0], falls[above, j]]))
        values[j + 1 :, j] = column(effective[j + 1 :])
    return EverettSurface(effective[0], effective[-1], values, float(levels[0]))
