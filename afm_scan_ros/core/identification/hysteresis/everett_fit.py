"""First-order reversal curves → the Everett surfaces of the hysteresis and of its inverse."""

import numpy as np
from attrs import frozen

from afm_scan_ros.core.effects.hysteresis.everett import EverettSurface
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.hysteresis.everett_equations import EverettGrid
from afm_scan_ros.core.identification.hysteresis.everett_least_squares import (
    FittedSurface,
    fit_surface,
)
from afm_scan_ros.core.identification.hysteresis.reversal_curves import ReversalCurves
from afm_scan_ros.core.model import HysteresisModel
from afm_scan_ros.core.types import Array

LEVELS = 51
"""Levels of alpha and beta, as in the paper."""
CROSSING = 0.01
"""Share of the output's range by which curves may cross and still be taken for noise."""


@frozen(eq=False)
class EverettFit:
    """Both surfaces, fitted monotone in ``model``, and freely beside it.

    ``closure`` is by how much F (V) differs from return to return to the same saturation.
    """

    model: HysteresisModel
    forward: FittedSurface
    direct: FittedSurface
    closure: float

    @property
    def effective_range(self) -> float:
        """Range of F from saturation to saturation, V."""
        return self.model.forward.output_upper - self.model.forward.output_lower

    @property
    def strengths(self) -> tuple[float, float]:
        """Strengths of the penalty on the forward and on the direct surface."""
        return self.forward.strength, self.direct.strength

    @property
    def noise(self) -> float:
        """Standard deviation of F (V) on the curves from that of the forward surface.

        It holds noise and, where minor loops are not congruent, what no surface can represent.
        """
        return self.forward.noise


def fit_everett(
    drive: Array,
    effective: Array,
    curves: ReversalCurves,
    levels: int = LEVELS,
    strengths: tuple[float, float] | None = None,
) -> EverettFit:
    """Surfaces from drive (V) and effective input F (V), both (n,), F freed of creep and vibration.

    Both have ``levels`` levels. The penalties' ``strengths`` are chosen by held-out points unless
    they are given. Raises InputError where the curves cross, so that there is no inverse.
    """
    found = curves.of(drive, effective)
    grid = EverettGrid(drive.min(), drive.max(), levels)
    smooth, direct_smooth = strengths or (None, None)
    forward = fit_surface(found, grid, smooth)
    bottoms, tops = curves.saturations(effective)
    direct_grid = EverettGrid(bottoms.mean(), tops.mean(), levels)
    direct = fit_surface([curve.exchanged() for curve in found], direct_grid, direct_smooth)
    closure = max(float(np.ptp(bottoms)), float(np.ptp(tops)))
    model = HysteresisModel(forward=surface(forward), direct=surface(direct))
    return EverettFit(model, forward, direct, closure)


def surface(fitted: FittedSurface) -> EverettSurface:
    """Fit again with a monotone surface.

    Raises InputError where that is too far from the first fit for noise.
    """
    grid, found = fitted.grid, fitted.monotone()
    values = found.values
    change = np.abs(values - fitted.values)
    if change.max() > CROSSING * values.max():
        i, j = np.unravel_index(change.argmax(), change.shape)
        raise InputError(
            f"hysteresis record: E does not grow with alpha and as beta falls at alpha ="
            f" {grid.levels[i]:.4g}, beta = {grid.levels[j]:.4g}: the curves cross there, so there"
            " is no inverse; record them again, slower or with less noise, after a creep record of"
            " the same scanner, each at the sample rate that it says"
        )
    return EverettSurface(grid.lower, grid.upper, values, found.offset)
