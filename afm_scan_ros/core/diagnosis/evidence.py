"""What the records say of one axis, in units of the floor, and which parts of it teach.

Each record is cut into blocks of equal length, which teach and test by turns; so a candidate is
judged on stretches that it was not fitted to, with the same memory of all that went before.
"""

from collections.abc import Sequence

import numpy as np
from attrs import field, frozen
from numpy.typing import NDArray

from afm_scan_ros.core.bands import rms_by_band, weighted
from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.diagnosis.discrepancy import DetectionLimit, with_moved_resonance
from afm_scan_ros.core.diagnosis.playback import Playback
from afm_scan_ros.core.effects.vibration import VibrationModel
from afm_scan_ros.core.types import Array

STRETCHES = 16
"""Of a record; half of them teach."""
AT_ONCE = 4
"""Samples in which a scanner has not yet moved: they say where it rested."""


@frozen(eq=False)
class Evidence:
    """One axis of one record, its floor, and the weights of its coefficients (n,).

    ``lines`` are a scan's, of which the level counts from the rest with which it began; no other
    record has any. ``stage`` is the vibration of the model that the floor is of, where it may move.
    ``fitted`` (n,) are the samples that a candidate is fitted to; it is tested on the others.
    """

    playback: Playback
    floor: DetectionLimit
    lines: slice | None = None
    stage: VibrationModel | None = None
    fitted: NDArray[np.bool_] = field(init=False)
    _weights: Array = field(init=False)

    @_weights.default
    def _of_floor(self) -> Array:
        view = self.playback.view
        return self.floor.weights(len(view.measured), view.sample_period)

    @fitted.default
    def _by_turns(self) -> NDArray[np.bool_]:
        count = len(self.playback.view.measured)
        return np.asarray(np.arange(count) * STRETCHES // count % 2 == 0)

    def residual(self, chain: Chain) -> Array:
        """Measured minus predicted displacement (n,) in m, without its mean."""
        left = self.playback.view.measured - self.playback.displacement(chain)
        return np.asarray(left - left.mean())

    def normalised_residual(self, chain: Chain) -> Array:
        """Residual (n,) with each band in units of its floor."""
        return weighted(self.residual(chain), self._weights)

    def whole(self, chain: Chain) -> Array:
        """Excess (n,) in which the mean counts too, where it is known: from the rest on.

        The mean is as slow as a motion can be, and so has the weight of the slowest.
        """
        left = self.residual(chain)
        if self.lines is None:
            return weighted(left, self._weights)
        weights = self._weights.copy()
        weights[0] = weights[1]
        return weighted(left - left[:AT_ONCE].mean(), weights)

    def left(self, chain: Chain) -> Array:
        """Residual (m,) in m of a scan's lines, from the rest on; of another record, of all."""
        left = self.residual(chain)
        return left if self.lines is None else left[self.lines] - left[:AT_ONCE].mean()

    def ratio(self, chain: Chain) -> Array:
        """Rms of the residual over the floor in each band (bands,)."""
        period = self.playback.view.sample_period
        found = rms_by_band(self.residual(chain), self.floor.edges, period)
        now = chain.of_record(self.playback.view.number).model.vibration
        floor = with_moved_resonance(self.floor, self.stage, now) if self.stage else self.floor.rms
        return np.asarray(found / floor)


def misfit(evidence: Sequence[Evidence], chain: Chain, *, fitted: bool) -> float:
    """Mean square of the excess, summed over the records: each band at its floor counts 1."""
    total = 0.0
    for each in evidence:
        mask = each.fitted if fitted else ~each.fitted
        total += float(np.mean(each.normalised_residual(chain)[mask] ** 2))
    return total
