"""What a hysteresis' table may be off by between its levels.

An Everett surface is read straight between its levels, so each level is a corner. A scan's drive is
made to undo the corners, and the scanner, which has none, is struck whenever it crosses a level.
Slow and smooth scans cross them as fast as stages resonate: 74 V/s over levels of 0.16 V are
460 Hz; records that move at other speeds tell nothing of it. A smooth surface through the same
values is as likely; by as much as the two differ, the table leaves the answer open. So the error of
an interpolation is told by one of higher order.
"""

import numpy as np
from attrs import evolve, frozen
from scipy.interpolate import RectBivariateSpline

from afm_scan_ros.core.chain import RATE_INDEPENDENT, Chain
from afm_scan_ros.core.diagnosis.playback import Playback
from afm_scan_ros.core.effects.hysteresis.everett import EverettSurface
from afm_scan_ros.core.types import Array

FINER = 4
"""Levels for one of the table: a sixteenth of a corner is left."""
CUBIC = 3


@frozen(eq=False)
class _GoneForwards(EverettSurface):
    """A surface that is not inverted, and so need not be monotone: a spline may swing over."""

    def __attrs_post_init__(self) -> None:
        """Refuse nothing."""


def smooth(surface: EverettSurface) -> EverettSurface:
    """Cubic surface through a table's values, as a table of ``FINER`` times as many levels.

    Across the diagonal, where it is zero, it goes on with the opposite sign.
    """
    last = len(surface.values) - 1
    below = np.tril(surface.values)
    levels, finer = np.arange(last + 1.0), np.arange(FINER * last + 1) / FINER
    order = min(CUBIC, last)
    spline = RectBivariateSpline(levels, levels, below - below.T, kx=order, ky=order)
    values = np.tril(spline(finer, finer), k=-1)
    return _GoneForwards(surface.lower, surface.upper, values, surface.offset)


def error_between_levels(playback: Playback, chain: Chain) -> Array:
    """Displacement (n,) in m with the table of a chain's model less that with the smooth surface.

    Whatever else the chain's hysteresis does, the table's corners are those of Preisach's.
    """
    chain = evolve(chain, hysteresis=RATE_INDEPENDENT)
    hysteresis = chain.model.hysteresis
    rounded = evolve(hysteresis, forward=smooth(hysteresis.forward))
    other = evolve(chain, model=evolve(chain.model, hysteresis=rounded))
    afresh = Playback(playback.view, playback.memory)
    return playback.displacement(chain) - afresh.displacement(other)
