"""Residuals of one axis of a record, plain and in units of the detection limit.

The record is cut into stretches of equal length. Values that are fitted to every other stretch
give the residual on the stretches between, which are held out.

The search of starting values takes hundreds of predictions, of a decimated record. Decimation keeps
the whole duration, and with it drift and the motion of the other axis, which an excerpt would not.
The rate is halved while two conditions hold. The model predicts the same displacement at the
remaining samples, and the residual at the removed frequencies is at its detection limit.
"""

from functools import cached_property

import numpy as np
from attrs import evolve, field, frozen
from numpy.typing import NDArray

from afm_scan_ros.core.bands import band_products, fast_length, rms_by_band, weighted
from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.diagnosis.discrepancy import AT_LIMIT, DetectionLimit, MotionByBand
from afm_scan_ros.core.diagnosis.records import Playback
from afm_scan_ros.core.types import Array

STRETCHES = 16
"""Stretches of a record; half of them are for fitting."""


@frozen(eq=False, slots=False)
class Evidence:
    """One axis of one record, its detection limit, and the weights of its coefficients (n,).

    ``untested`` is the record's motion where the model's error is not known for such a motion.
    ``base`` (m, n) is the displacement (m) that one standard deviation of each free parameter of
    the base model adds. ``fitted`` (n,) are the samples of every other stretch.
    """

    playback: Playback
    limit: DetectionLimit
    untested: MotionByBand | None = None
    base: Array = field()
    fitted: NDArray[np.bool_] = field(init=False)
    _weights: Array = field(init=False)

    @base.default
    def _held(self) -> Array:
        return np.empty((0, len(self.playback.view.measured)))

    @_weights.default
    def _of_limit(self) -> Array:
        view = self.playback.view
        return self.limit.weights(len(view.measured), view.sample_period)

    @fitted.default
    def _by_turns(self) -> NDArray[np.bool_]:
        count = len(self.playback.view.measured)
        return np.asarray(np.arange(count) * STRETCHES // count % 2 == 0)

    def from_depolarised(self) -> "Evidence":
        """The same evidence with a depolarised scanner at the record's start."""
        if self.playback.initial_state.blank:
            return self
        return evolve(self, playback=Playback(self.playback.view))

    def with_base(self, deviations: Array) -> "Evidence":
        """The same evidence under a base model whose free parameters deviate (m,)."""
        if not len(deviations):
            return self
        view = self.playback.view
        measured = view.measured - deviations @ self.base
        playback = Playback(evolve(view, measured=measured), self.playback.initial_state)
        return evolve(self, playback=playback)

    def residual(self, chain: Chain) -> Array:
        """Measured minus predicted displacement (n,) in m, without its mean."""
        left = self.playback.view.measured - self.playback.displacement(chain)
        return np.asarray(left - left.mean())

    def normalised_residual(self, chain: Chain) -> Array:
        """Residual (n,) with each band in units of its detection limit."""
        return self.normalised(self.residual(chain))

    def normalised(self, signal: Array) -> Array:
        """Signal (n,) in m with each band in units of its detection limit."""
        return weighted(signal, self._weights)

    def on_fitted(self, signal: Array) -> Array:
        """The same (m,) on the stretches that a fit for the held-out ones sees."""
        return self.normalised(signal)[self.fitted]

    def band_products(self, one: Array, other: Array) -> Array:
        """Mean products (bands, m, k) in m² of signals with coefficients (m, n) and (k, n)."""
        return band_products(one, other, self.limit.edges, self.playback.view.sample_period)

    def power(self, signal: Array) -> Array:
        """Mean square (bands,) in m² of a signal (n,) in m."""
        return rms_by_band(signal, self.limit.edges, self.playback.view.sample_period) ** 2

    @cached_property
    def reach(self) -> float:
        """Frequency (Hz) up to which the record's motion exceeds its detection limit."""
        view = self.playback.view
        moved = rms_by_band(view.measured, self.limit.edges, view.sample_period)
        above = np.flatnonzero(moved > 2.0**0.5 * self.limit.rms)
        return self.limit.edges[above[-1] + 1] if len(above) else 0.0

    def ratio(self, chain: Chain) -> Array:
        """Rms of the residual over the detection limit in each band (bands,)."""
        period = self.playback.view.sample_period
        return rms_by_band(self.residual(chain), self.limit.edges, period) / self.limit.rms


LONG_RECORD = 8_000
"""Samples up to which a record is not decimated, because its predictions take little time."""
EQUAL_WITHIN = 0.3
"""Share of the detection limit by which a prediction may differ in any band, a tenth in power."""


def decimated(evidence: Evidence, chain: Chain) -> Evidence:
    """Evidence at the lowest rate that determines a chain as well; short records unchanged."""
    if len(evidence.playback.view.drive) <= LONG_RECORD:
        return evidence
    fewer = _every_other(evidence)
    return decimated(fewer, chain) if _same(evidence, fewer, chain) else evidence


def _every_other(evidence: Evidence) -> Evidence:
    """Evidence of every other sample, with the drive averaged over pairs of samples."""
    view = evidence.playback.view
    count = fast_length(len(view.drive) // 2)
    drive = view.drive[: 2 * count].reshape(count, 2).mean(axis=1)
    measured, other = (each[: 2 * count : 2].copy() for each in (view.measured, view.other))
    period = 2.0 * view.sample_period
    fewer = evolve(view, sample_period=period, drive=drive, measured=measured, other=other)
    playback = Playback(fewer, evidence.playback.initial_state)
    base = evidence.base[:, : 2 * count : 2]
    return Evidence(playback, evidence.limit.sampled(period), base=base)


def _same(evidence: Evidence, fewer: Evidence, chain: Chain) -> bool:
    """Whether the samples left out hold no more information on a chain."""
    predicted, sampled = (e.playback.displacement(chain) for e in (fewer, evidence))
    moved = predicted - sampled[: 2 * len(predicted) : 2]
    limit = fewer.limit
    differs = rms_by_band(moved, limit.edges, fewer.playback.view.sample_period) / limit.rms
    unseen = np.array(evidence.limit.edges[1:]) > limit.edges[-1]
    return bool(differs.max() < EQUAL_WITHIN and evidence.ratio(chain)[unseen].max() < AT_LIMIT)
