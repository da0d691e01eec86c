"""Residuals of one axis in units of the detection limit, split into fitting and test stretches.

Each record is cut into stretches of equal length, alternately for fitting and testing. A candidate
is scored on stretches that it was not fitted to, with the full history before them.
"""

from collections.abc import Sequence

import numpy as np
from attrs import field, frozen
from numpy.typing import NDArray

from afm_scan_ros.core.bands import rms_by_band, weighted
from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.diagnosis.coverage import Motion
from afm_scan_ros.core.diagnosis.discrepancy import DetectionLimit, with_moved_resonance
from afm_scan_ros.core.diagnosis.playback import Playback
from afm_scan_ros.core.effects.vibration import VibrationModel
from afm_scan_ros.core.types import Array

STRETCHES = 16
"""Stretches of a record; half of them are for fitting."""
AT_ONCE = 4
"""First samples, in which the scanner has not yet moved; they give its rest position."""


@frozen(eq=False)
class Evidence:
    """One axis of one record, its detection limit, and the weights of its coefficients (n,).

    ``lines`` are those of a scan, whose level is relative to its initial rest; other records have
    none. ``stage`` is the model's vibration for which the limit holds, where an effect may move it.
    ``untested`` is the record's motion where the model's error is not known for such a motion.
    ``fitted`` (n,) are the samples that a candidate is fitted to; it is tested on the others.
    """

    playback: Playback
    limit: DetectionLimit
    lines: slice | None = None
    stage: VibrationModel | None = None
    untested: Motion | None = None
    fitted: NDArray[np.bool_] = field(init=False)
    _weights: Array = field(init=False)

    @_weights.default
    def _of_limit(self) -> Array:
        view = self.playback.view
        return self.limit.weights(len(view.measured), view.sample_period)

    @fitted.default
    def _by_turns(self) -> NDArray[np.bool_]:
        count = len(self.playback.view.measured)
        return np.asarray(np.arange(count) * STRETCHES // count % 2 == 0)

    def residual(self, chain: Chain) -> Array:
        """Measured minus predicted displacement (n,) in m, without its mean."""
        left = self.playback.view.measured - self.playback.displacement(chain)
        return np.asarray(left - left.mean())

    def normalised_residual(self, chain: Chain) -> Array:
        """Residual (n,) with each band in units of its detection limit."""
        return weighted(self.residual(chain), self._weights)

    def whole(self, chain: Chain) -> Array:
        """Normalised residual (n,) of a scan with its level from the rest on.

        The mean has the weight of the slowest coefficient. Other records have their mean removed.
        """
        left = self.residual(chain)
        if self.lines is None:
            return weighted(left, self._weights)
        weights = self._weights.copy()
        weights[0] = weights[1]
        return weighted(left - left[:AT_ONCE].mean(), weights)

    def left(self, chain: Chain) -> Array:
        """Residual (m,) in m of a scan's lines from the rest on, or of all of another record."""
        left = self.residual(chain)
        return left if self.lines is None else left[self.lines] - left[:AT_ONCE].mean()

    def ratio(self, chain: Chain) -> Array:
        """Rms of the residual over the detection limit in each band (bands,)."""
        period = self.playback.view.sample_period
        found = rms_by_band(self.residual(chain), self.limit.edges, period)
        now = chain.of_record(self.playback.view.number).model.vibration
        limit = with_moved_resonance(self.limit, self.stage, now) if self.stage else self.limit.rms
        return np.asarray(found / limit)


def misfit(evidence: Sequence[Evidence], chain: Chain, *, fitted: bool) -> float:
    """Mean square of the normalised residual, summed over records; a band at its limit counts 1."""
    total = 0.0
    for each in evidence:
        mask = each.fitted if fitted else ~each.fitted
        total += float(np.mean(each.normalised_residual(chain)[mask] ** 2))
    return total
