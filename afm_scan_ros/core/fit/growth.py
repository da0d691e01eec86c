"""Where the surface of plays does not grow: only one that does has an inverse.

Once a drive u has turned, the plays up to some threshold R follow it, and A changes by

    S(u, R) = Σ_{r ≤ R} T_r'(u ∓ r)    for each volt of a rise or a fall,

which is linear in the weights. It is to be at least the settings' ``least_slope``.
"""

import numpy as np
from attrs import field, frozen
from numpy.typing import NDArray
from scipy.interpolate import BSpline

from afm_scan_ros.core.fit.plays import Plays
from afm_scan_ros.core.types import Array


@frozen(eq=False)
class Growth:
    """S of plays at levels of the drive's range, of a rise and of a fall."""

    plays: Plays
    _splines: Array = field(init=False)
    _follows: NDArray[np.bool_] = field(init=False)

    @_splines.default
    def _at_levels(self) -> Array:
        """Splines at u - r and at u + r, shape (2, levels, plays, splines)."""
        ways = np.array([-1.0, 1.0])[:, np.newaxis, np.newaxis]
        places = self._levels[:, np.newaxis] + ways * self._thresholds
        inside = np.clip(places, self.plays.knots[2], self.plays.knots[-3])
        found = BSpline.design_matrix(inside.ravel(), self.plays.knots, 2).toarray()
        return np.asarray(found.reshape(*places.shape, -1))

    @_follows.default
    def _that_follow(self) -> NDArray[np.bool_]:
        """Whether a play can have been pushed back before, shape (2, levels, plays)."""
        levels = self._levels
        rises = np.array([levels - self.plays.lower, self.plays.upper - levels])
        return np.asarray(2.0 * self._thresholds <= rises[:, :, np.newaxis])

    @property
    def _levels(self) -> Array:
        return np.linspace(self.plays.lower, self.plays.upper, self.plays.settings.surface_levels)

    @property
    def _thresholds(self) -> Array:
        return self.plays.thresholds[self.plays.thresholds <= self.plays.half]

    def lacking(self, theta: Array) -> tuple[Array, Array]:
        """Least S at each level where it is too small, as linear conditions on the weights.

        Returns their rows, shape (conditions, weights), and by how much each lacks, both over the
        settings' ``slope_tolerance``: what lacks changes by minus the rows times a change of theta.
        """
        plays, count = self.plays, len(self._thresholds)
        widths, blend = plays.widths[:count], plays.blend[:count]
        density, correction = (each[:count] for each in plays.weights(theta))
        along = np.einsum("dlrs,rs->dlr", self._splines, correction)
        slopes = np.cumsum(widths * (density + along), axis=2)
        slopes[~self._follows] = np.inf
        last, least = np.argmin(slopes, axis=2), slopes.min(axis=2)
        settings = plays.settings
        places = np.argwhere(least < settings.least_slope)
        rows = np.zeros((len(places), len(theta)))
        for row, (way, level) in zip(rows, places, strict=True):
            upto = slice(last[way, level] + 1)
            row[upto] = widths[upto]
            mixed = (widths[upto, np.newaxis] * blend[upto]).T @ self._splines[way, level, upto]
            row[len(plays.thresholds) :] = mixed[plays.reached]
        lacks = settings.least_slope - least[tuple(places.T)]
        return rows / settings.slope_tolerance, lacks / settings.slope_tolerance
