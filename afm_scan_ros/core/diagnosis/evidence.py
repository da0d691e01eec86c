"""Residuals of one axis of a record, plain and in units of the detection limit.

The record is cut into stretches of equal length. Values that are fitted to every other stretch
give the residual on the stretches between, which are held out.

The search of starting values takes hundreds of predictions, of a decimated record. Decimation keeps
the whole duration, and with it drift and the motion of the other axis, which an excerpt would not.
The rate is halved while two conditions hold. The model predicts the same displacement at the
remaining samples, and the residual at the removed frequencies is at its detection limit and has no
lasting line.
"""

from functools import cached_property

import numpy as np
from attrs import evolve, field, frozen
from numpy.typing import NDArray

from afm_scan_ros.core.bands import fast_length, rms_by_band, weighted
from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.diagnosis.cells import RecordCells
from afm_scan_ros.core.diagnosis.discrepancy import DetectionLimit, MotionByBand
from afm_scan_ros.core.diagnosis.records import Playback
from afm_scan_ros.core.diagnosis.settings import DECIMATION, EVIDENCE, LIMIT, VARIANCE
from afm_scan_ros.core.diagnosis.tones import lasting_lines
from afm_scan_ros.core.diagnosis.variance import CellVariance
from afm_scan_ros.core.effects.creep import Creep, CreepModel
from afm_scan_ros.core.effects.drift import Drift
from afm_scan_ros.core.effects.periodic_disturbance import Disturbance
from afm_scan_ros.core.effects.slow_creep import NortonCreep
from afm_scan_ros.core.types import Array


@frozen(eq=False, slots=False)
class Evidence:
    """One axis of one record, its detection limit, and the variance of its residual by cell.

    ``untested`` is the record's motion where the model's error is not known for such a motion.
    ``base`` (m, n) is the displacement (m) that one standard deviation of each free parameter of
    the base model adds. ``cells`` are those of the model's motion, and ``variance`` is that of a
    residual in them. ``weights`` (cells,) in 1/m² are those of least squares, by default for a
    residual as expected. ``between`` (l,) are the coefficients between the harmonics of what the
    model leaves without what never repeats. Only that changes them: what the motion changes there
    is the model's error before it is an effect. ``creep`` is the creep of that model. ``fitted``
    (n,) are the samples of every other stretch.
    """

    playback: Playback
    limit: DetectionLimit
    untested: MotionByBand | None = None
    base: Array = field()
    cells: RecordCells = field()
    variance: CellVariance = field()
    weights: Array = field()
    between: Array = field(factory=lambda: np.empty(0))
    creep: CreepModel | None = None
    fitted: NDArray[np.bool_] = field(init=False)

    @base.default
    def _held(self) -> Array:
        return np.empty((0, len(self.playback.view.measured)))

    @cells.default
    def _by_band(self) -> RecordCells:
        view = self.playback.view
        return RecordCells(self.limit.edges, len(view.measured), view.sample_period)

    @variance.default
    def _of_limit(self) -> CellVariance:
        return CellVariance.of_motion(self.limit, self.known_from)

    @weights.default
    def _expected(self) -> Array:
        return self.variance.expected_weights

    @fitted.default
    def _by_turns(self) -> NDArray[np.bool_]:
        count = len(self.playback.view.measured)
        return np.asarray(np.arange(count) * EVIDENCE.stretches // count % 2 == 0)

    @property
    def known_from(self) -> float:
        """Amplitudes from which the model's error is known."""
        return VARIANCE.untested if self.untested else VARIANCE.known

    def with_cells(self, cells: RecordCells, chain: Chain) -> "Evidence":
        """The same evidence by other cells, with the variance that a chain's residual tells."""
        moved, residual = self.playback.displacement(chain), self.residual(chain)
        if self.still(chain):
            variance = CellVariance.at_rest(self.limit, self.cells, moved, self.known_from)
            return evolve(self, variance=variance, weights=variance.expected_weights)
        if cells.repetition is None:
            return self
        variance = CellVariance.repeating(self.limit, cells, moved, residual, self.known_from)
        between = cells.between((residual + self._disturbance(chain))[np.newaxis])[0]
        return evolve(
            self,
            cells=cells,
            variance=variance,
            weights=variance.expected_weights,
            between=between,
            creep=chain.model.creep,
        )

    def from_depolarised(self, chain: Chain) -> "Evidence":
        """The same evidence with a depolarised scanner at the record's start."""
        if self.playback.initial_state.blank:
            return self
        begun = evolve(self, playback=Playback(self.playback.view))
        return begun.with_cells(self.cells, chain)

    def with_base(self, deviations: Array) -> "Evidence":
        """The same evidence under a base model whose free parameters deviate (m,)."""
        if not len(deviations):
            return self
        view = self.playback.view
        measured = view.measured - deviations @ self.base
        playback = Playback(evolve(view, measured=measured), self.playback.initial_state)
        return evolve(self, playback=playback)

    def still(self, chain: Chain) -> bool:
        """Whether a chain moves too little for the record to show anything of it."""
        moved = np.ptp(self.playback.displacement(chain))
        return bool(moved <= EVIDENCE.least_motion * np.linalg.norm(self.limit.noise))

    def residual(self, chain: Chain) -> Array:
        """Measured minus predicted displacement (n,) in m, without its mean."""
        left = self.playback.view.measured - self.playback.displacement(chain)
        return np.asarray(left - left.mean())

    def lasting_lines(self, chain: Chain) -> tuple[float, ...]:
        """Frequencies (Hz) of lasting lines between the harmonics of a motion, or at rest."""
        of, residual = self.cells.repetition, self.residual(chain)
        if of is not None:
            residual = of.signal(of.between(residual[np.newaxis])[0])
        elif not self.still(chain):
            return ()
        return lasting_lines(residual, self.cells.sample_period, of)

    def normalised_residual(self, chain: Chain) -> Array:
        """Residual (n,) with each band in units of its detection limit."""
        view = self.playback.view
        weights = self.limit.weights(len(view.measured), view.sample_period)
        return weighted(self.residual(chain), weights)

    def coefficients(self, chain: Chain) -> Array:
        """Coefficients (k,) of a chain's residual; between harmonics less what never repeats."""
        disturbed = self._disturbance(chain)
        between = self.between
        if disturbed.any():
            between = between - self.cells.between(disturbed[np.newaxis])[0]
        return self.cells.coefficients(self.residual(chain), between)

    def _disturbance(self, chain: Chain) -> Array:
        """Displacement (n,) in m by what never repeats in a chain, whatever it does besides."""
        chain = chain.of_record(self.playback.view.number)
        without = repeating(chain, self.creep or chain.model.creep)
        if without == chain:
            return np.zeros(len(self.playback.view.drive))
        return self.playback.displacement(chain) - self._without.displacement(without)

    @cached_property
    def _without(self) -> Playback:
        """Playback of chains without disturbances, that keeps what is evaluated of them."""
        return Playback(self.playback.view, self.playback.initial_state)

    def whitened(self, coefficients: Array) -> Array:
        """Coefficients (k,), each times the root of its cell's weight."""
        return np.asarray(self.cells.spread(np.sqrt(self.weights)) * coefficients)

    def whitened_along(self, coefficients: Array) -> Array:
        """The same of those with the motion (n,), which are all that its effects change."""
        return self.whitened(coefficients)[: self.cells.count]

    def on_fitted(self, coefficients: Array) -> Array:
        """The same as a signal (m,), on the stretches that a fit for the held-out ones sees."""
        found = self.cells.signal(self.whitened(coefficients))[self.fitted]
        return np.asarray(found / np.sqrt(len(found)))

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


UNREPEATED = Disturbance, Drift, Creep, NortonCreep
"""Elements whose motion does not repeat with the drive's."""


def repeating(chain: Chain, creep: CreepModel) -> Chain:
    """Return the chain of one record with some creep, and no elements of unrepeated motion."""
    drive, output = (
        tuple(each for each in elements if getattr(each, "make", None) not in UNREPEATED)
        for elements in (chain.drive, chain.output)
    )
    left = evolve(chain, drive=drive, output=output)
    return left if chain.model.creep == creep else left.with_model(creep=creep)


def decimated(evidence: Evidence, chain: Chain) -> Evidence:
    """Evidence at the lowest rate that determines a chain as well; short records unchanged."""
    if len(evidence.playback.view.drive) <= DECIMATION.longest:
        return evidence
    fewer = _every_other(evidence, chain)
    return decimated(fewer, chain) if _same(evidence, fewer, chain) else evidence


def _every_other(evidence: Evidence, chain: Chain) -> Evidence:
    """Evidence of every other sample, with the drive averaged over pairs of samples."""
    view = evidence.playback.view
    count = fast_length(len(view.drive) // 2)
    period = 2.0 * view.sample_period
    playback = Playback(view.halved(count), evidence.playback.initial_state)
    base = evidence.base[:, : 2 * count : 2]
    limit, of = evidence.limit.sampled(period), evidence.cells.repetition
    cells = RecordCells(limit.edges, count, period, of and of.halved(count))
    return Evidence(playback, limit, evidence.untested, base).with_cells(cells, chain)


def _same(evidence: Evidence, fewer: Evidence, chain: Chain) -> bool:
    """Whether the samples left out hold no more information on a chain."""
    predicted, sampled = (e.playback.displacement(chain) for e in (fewer, evidence))
    moved = predicted - sampled[: 2 * len(predicted) : 2]
    limit = fewer.limit
    differs = rms_by_band(moved, limit.edges, fewer.playback.view.sample_period) / limit.rms
    unseen, lines = (
        np.array(evidence.limit.edges[1:]) > limit.edges[-1],
        evidence.lasting_lines(chain),
    )
    below = max(lines, default=0.0) < limit.edges[-1]
    quiet = bool(evidence.ratio(chain)[unseen].max() < LIMIT.expected)
    return bool(differs.max() < DECIMATION.equal_within) and quiet and below
