"""The detection limit: the residual that sensor noise and model discrepancy explain, by band.

The validation records state the model discrepancy. It scales with the motion in a band or with
the whole motion, whichever gives more. The second counts because an error of a slow motion has
harmonics at higher frequencies.

The Everett surface adds an error between its levels. It is interpolated linearly, so each level is
a corner. The scanner has no corners, and the inverse excites it at the rate of crossing levels:
74 V/s over levels of 0.16 V gives 460 Hz. The error is estimated by the difference from a cubic
interpolation through the same values.

A model's error on one kind of motion says little of another kind. Effects of the rate grow with the
rate, and the relative error of hysteresis grows as loops shrink. Larger motion is bounded by the
range that the model was identified in.
"""

from collections.abc import Sequence

import numpy as np
import scipy
from attrs import evolve, field, frozen
from numpy.typing import NDArray

from afm_scan_ros.core.bands import rms_by_band, spread
from afm_scan_ros.core.chain import RATE_INDEPENDENT, Chain
from afm_scan_ros.core.diagnosis.records import Playback
from afm_scan_ros.core.diagnosis.settings import LIMIT
from afm_scan_ros.core.effects.hysteresis.everett import EverettSurface
from afm_scan_ros.core.model import (
    VIBRATING,
    ModelDiscrepancy,
    band_edges,
    edge_at,
)
from afm_scan_ros.core.spread import Spread
from afm_scan_ros.core.types import Array, floats

SMALLEST = 1e-15
"""m; added to a motion, so that a record at rest has a logarithm."""


@frozen(eq=False)
class DetectionLimit:
    """Rms (n,) in m that is no effect, in n bands between n + 1 ``edges`` (Hz).

    ``noise`` (n,) is the sensor's part of it, ``resonance`` (Hz) the first of the model.
    """

    edges: tuple[float, ...] = field(converter=floats)
    rms: Array
    noise: Array
    resonance: float

    @property
    def vibrating(self) -> NDArray[np.bool_]:
        """Bands (n,) in which unmodelled modes may dominate the error."""
        return _vibrating(np.array(self.edges), self.resonance)

    @property
    def total(self) -> float:
        """Rms over all bands, m."""
        return float(np.linalg.norm(self.rms))

    def at_least(self, error: Array) -> "DetectionLimit":
        """Detection limit that includes an rms error (bands,) in m predicted for the record.

        The model discrepancy's record held such a part too, so the larger of the two counts.
        """
        return evolve(self, rms=np.maximum(self.rms, error))

    def unprepared(self, duration: float) -> "DetectionLimit":
        """Detection limit of a record of some length (s) that did not begin with a preparation.

        The scanner may rest in a state other than depolarised. The first large move removes this
        state in one step, which lies in the bands of the first few cycles. A scan is prepared by
        such moves and has no such step.
        """
        stepped = np.array(self.edges[:-1]) < LIMIT.first_cycles / duration
        return evolve(self, rms=np.where(stepped, LIMIT.unprepared_factor, 1.0) * self.rms)

    def sampled(self, sample_period: float) -> "DetectionLimit":
        """Detection limit of the same record at a longer sample period (s), noise folded."""
        nyquist = 0.5 / sample_period
        edges = np.array([*(edge for edge in self.edges if edge < nyquist), nyquist])
        error = np.sqrt(np.maximum(self.rms**2 - self.noise**2, 0.0))[: len(edges) - 1]
        noise = _white(float(np.linalg.norm(self.noise)), edges)
        return evolve(self, edges=edges, rms=np.hypot(error, noise), noise=noise)

    def weights(self, count: int, sample_period: float) -> Array:
        """Weights of a signal's coefficients that put each band in units of its limit."""
        return spread(1.0 / self.rms, self.edges, count, sample_period)


def detection_limit(
    known: Sequence[ModelDiscrepancy],
    displacement: Array,
    sample_period: float,
    resonance: float,
    stated: Spread | None = None,
) -> DetectionLimit:
    """Detection limit of a record of ``displacement`` (n,) in m under a model of ``known`` errors.

    ``resonance`` (Hz) is the first of the model. A record of the same kind of motion tells the
    error itself. For other motion it is a share of the motion in each band, by the amplitude
    between the records that moved there, and at least a share of the whole motion, the least of
    all records: what any of them leaves there contains its creep and its harmonics. The share that
    a model ``stated`` beyond its parameters adds to it. Harmonics hold up to half of an
    error in the next band, because the error of the hysteresis is not sinusoidal. From
    ``VIBRATING`` on at least the largest share of all records counts: unmodelled modes dominate
    there, and not every drive excites them. Records that were fitted tell no error of other motion,
    unless there are no others.
    """
    edges = np.array(band_edges(sample_period, resonance))
    moved = rms_by_band(displacement, edges, sample_period)
    noise = _white(max(float(np.linalg.norm(one.noise)) for one in known), edges)
    every = [_BandDiscrepancy.of(each, edges) for each in known]
    if alike := [part for part in every if part.alike(moved)]:
        error = np.max([part.larger(moved) for part in alike], axis=0)
    else:
        parts = [part for part in every if not part.fitted] or every
        beyond = np.array(stated.shares)[_places(stated.bands, edges)] if stated else 0.0
        error = _of_other_motion(parts, moved, beyond * moved, _vibrating(edges, resonance))
    return DetectionLimit(edges, np.hypot(error, noise), noise, resonance)


def moves_alike(known: Sequence[ModelDiscrepancy], edges: Array, moved: Array) -> bool:
    """Whether a model's error is known on motion like that of ``moved`` (bands,) in m."""
    return any(_BandDiscrepancy.of(one, edges).alike(moved) for one in known)


def places_moved(moved: Array) -> NDArray[np.intp]:
    """Places of the bands that hold motion, of one that moves ``moved`` (bands,) in m rms."""
    return np.flatnonzero((moved > 0.0) & (moved >= LIMIT.least_moved * moved.max()))


def _vibrating(edges: Array, resonance: float) -> NDArray[np.bool_]:
    return np.asarray(edges[:-1] >= edge_at(VIBRATING, resonance))


def _white(rms: float, edges: Array) -> Array:
    """Rms of white noise in the bands (n,) between n + 1 edges, of its rms in all."""
    return np.asarray(rms * np.sqrt(np.diff(edges) / edges[-1]))


def _places(bands: Sequence[float], edges: Array) -> NDArray[np.intp]:
    """Places among other ``bands`` of the middles of those between n + 1 edges (Hz), (n,)."""
    middles = 0.5 * (edges[1:] + edges[:-1])
    return np.clip(np.searchsorted(bands, middles) - 1, 0, len(bands) - 2)


def _of_other_motion(
    parts: Sequence["_BandDiscrepancy"], moved: Array, stated: Array, vibrating: NDArray[np.bool_]
) -> Array:
    """Rms error (bands,) in m of a motion, by records of other motion and what is ``stated``."""
    least = np.min([part.of_whole(moved) for part in parts], axis=0)
    error = np.hypot(np.maximum(_of_motion(parts, moved), least), stated)
    for above in 1 + np.flatnonzero(~vibrating[:-1]):
        error[above] = max(error[above], LIMIT.harmonic_share * error[above - 1])
    missed = LIMIT.missed_factor * np.max([part.shares for part in parts], axis=0) * moved
    return np.asarray(np.where(vibrating, np.maximum(error, missed), error))


def _of_motion(parts: Sequence["_BandDiscrepancy"], moved: Array) -> Array:
    """Rms error (bands,) in m of a motion, as a share of it by the records that moved in a band.

    The share is interpolated over the amplitude, as the relative error of hysteresis depends on
    it, and is the largest of all bands where no record moved.
    """
    parts = sorted(parts, key=lambda part: part.amplitude)
    moving = np.array([part.moving for part in parts])
    shares = np.array([part.shares for part in parts])
    sizes = np.log([part.amplitude for part in parts])
    here, most = np.log(np.linalg.norm(moved) + SMALLEST), np.max(shares, where=moving, initial=0.0)
    told = [
        np.interp(here, sizes[k], share[k]) if k.any() else most
        for share, k in zip(shares.T, moving.T, strict=True)
    ]
    return np.asarray(moved * np.array(told))


@frozen(eq=False)
class _BandDiscrepancy:
    """A model discrepancy in a record's bands: ``rms`` and ``displacement`` (bands,) in m."""

    rms: Array
    displacement: Array
    amplitude: float
    fitted: bool

    @classmethod
    def of(cls, known: ModelDiscrepancy, edges: Array) -> "_BandDiscrepancy":
        band = _places(known.bands, edges)
        rms, displacement = np.array(known.rms)[band], np.array(known.displacement)[band]
        amplitude = float(np.linalg.norm(known.displacement))
        return cls(rms, np.maximum(displacement, SMALLEST), max(amplitude, SMALLEST), known.fitted)

    def alike(self, moved: Array) -> bool:
        """Whether a motion of ``moved`` (bands,) in m is as large in each band that counts."""
        own = self.displacement
        counts = np.union1d(places_moved(moved), places_moved(own))
        larger, smaller = (which(moved, own)[counts] for which in (np.maximum, np.minimum))
        return bool(np.all(larger <= LIMIT.alike * smaller))

    @property
    def moving(self) -> NDArray[np.bool_]:
        """Whether the record moved in each band, (bands,)."""
        least = max(LIMIT.least_moved * self.displacement.max(), 2.0 * SMALLEST)
        return np.asarray(self.displacement >= least)

    @property
    def shares(self) -> Array:
        """Rms error over the motion in each band, (bands,)."""
        return self.rms / self.displacement

    def of_whole(self, moved: Array) -> Array:
        """Rms error (bands,) in m of another motion of ``moved`` (bands,) in m, as its share."""
        return np.asarray(self.rms * (np.linalg.norm(moved) / self.amplitude))

    def larger(self, moved: Array) -> Array:
        """Rms error (bands,) in m of motion alike, which may be the larger one."""
        return np.maximum(self.rms, self.of_whole(moved))


FINER = 4
"""Levels per level of the table; the corners shrink to a sixteenth."""
CUBIC_ORDER = 3


@frozen(eq=False)
class _ForwardHysteresis(EverettSurface):
    """A surface evaluated forwards only. It need not be monotone: a spline may overshoot."""

    def __attrs_post_init__(self) -> None:
        """Refuse nothing."""


def smooth(surface: EverettSurface) -> EverettSurface:
    """Cubic surface through a table's values, as a table of ``FINER`` times as many levels.

    It is extended as an odd function across the diagonal, where it is zero.
    """
    last = len(surface.values) - 1
    below, levels = np.tril(surface.values), surface.levels
    finer = np.interp(np.arange(FINER * last + 1) / FINER, np.arange(last + 1), levels)
    order = min(CUBIC_ORDER, last)
    spline = scipy.interpolate.RectBivariateSpline(
        levels, levels, below - below.T, kx=order, ky=order
    )
    values = np.tril(spline(finer, finer), k=-1)
    limits, known = (surface.lower, surface.upper), (surface.offset, surface.bias)
    return _ForwardHysteresis(*limits, values, *known, uneven=finer, within=surface.within)


def error_between_levels(playback: Playback, chain: Chain) -> Array:
    """Displacement (n,) in m with the table of a chain's model minus that with the smooth surface.

    Both use rate-independent hysteresis, since the corners come from the Preisach table alone. A
    Duhem operator has none.
    """
    if not isinstance(chain.model.hysteresis.forward, EverettSurface):
        return np.zeros(len(playback.view.drive))
    chain = evolve(chain, hysteresis=RATE_INDEPENDENT)
    hysteresis = chain.model.hysteresis
    rounded = evolve(hysteresis, forward=smooth(hysteresis.surface))
    other = chain.with_model(hysteresis=rounded)
    afresh = Playback(playback.view, playback.initial_state)
    return playback.displacement(chain) - afresh.displacement(other)


@frozen
class MotionByBand:
    """Motion of ``size`` (m rms) in the bands from ``low`` to ``high`` (Hz)."""

    size: float
    low: float
    high: float

    @classmethod
    def of(cls, edges: Sequence[float] | Array, moved: Array) -> "MotionByBand":
        """Return the motion of ``moved`` (bands,) in m rms between ``edges`` (Hz)."""
        places = places_moved(moved)
        return cls(
            float(np.linalg.norm(moved)), float(edges[places[0]]), float(edges[places[-1] + 1])
        )


def tested_motion(known: Sequence[ModelDiscrepancy]) -> MotionByBand | None:
    """Smallest motion, and all rates, at which the error is known; None where at none.

    Motion that was fitted does not count.
    """
    sizes = [(one.bands, np.array(one.displacement)) for one in known if not one.fitted]
    motions = [MotionByBand.of(bands, moved) for bands, moved in sizes if moved.any()]
    if not motions:
        return None
    smallest = min(one.size for one in motions)
    return MotionByBand(smallest, min(one.low for one in motions), max(one.high for one in motions))


def untested_motion(
    known: Sequence[ModelDiscrepancy], displacement: Array, sample_period: float, resonance: float
) -> MotionByBand | None:
    """Motion of a ``displacement`` (n,) in m, if a model of ``known`` errors was tested at none.

    None where a record of the same kind is known, or others as small and at such rates.
    """
    edges = np.array(band_edges(sample_period, resonance))
    moved = rms_by_band(displacement, edges, sample_period)
    if moves_alike(known, edges, moved):
        return None
    motion, tested = MotionByBand.of(edges, moved), tested_motion(known)
    within = tested and (
        motion.size * LIMIT.alike >= tested.size
        and motion.low >= tested.low
        and motion.high <= tested.high
    )
    return None if within else motion
