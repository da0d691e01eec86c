"""The floor of a residual: what is left of a record although nothing is missing in the model.

It is the sensor's noise and the error that is known of the model, band by band. A validation
record says how large that error is beside the motion in its band, and beside all motion, for a
slow motion errs at higher frequencies too (a hysteresis that is not quite the model's has
harmonics); the larger of the two counts.

What a hysteresis' table may be off by between its levels.

An Everett surface is read straight between its levels, so each level is a corner. A scan's drive is
made to undo the corners, and the scanner, which has none, is struck whenever it crosses a level.
Slow and smooth scans cross them as fast as stages resonate: 74 V/s over levels of 0.16 V are
460 Hz; records that move at other speeds tell nothing of it. A smooth surface through the same
values is as likely; by as much as the two differ, the table leaves the answer open. So the error of
an interpolation is told by one of higher order.

How a floor moves with a resonance that an effect has moved.

What a model errs by at the drive rings through the stage, and is loudest where that resonates. A
mass that has come to ride on it takes the resonance, and so this error, into another band.
"""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from attrs import evolve, field, frozen
from scipy.interpolate import RectBivariateSpline

from afm_scan_ros.core.bands import rms_by_band, spread
from afm_scan_ros.core.chain import RATE_INDEPENDENT, Chain
from afm_scan_ros.core.diagnosis.playback import Playback
from afm_scan_ros.core.effects.hysteresis.everett import EverettSurface
from afm_scan_ros.core.effects.vibration import VibrationModel
from afm_scan_ros.core.model_discrepancy import ModelDiscrepancy, band_edges
from afm_scan_ros.core.types import Array, floats

AT_LIMIT = 1.8
"""Largest ratio of a band's rms to its floor at which nothing is missing, and none is sought."""
VIBRATING, MISSED_FACTOR = 300.0, 1.5
"""Hz from which a model errs by the modes that it lacks, and by how many times the share known."""
HARMONIC_SHARE = 0.5
"""Share of a slow motion's error that its harmonics may come to, in the band above it."""
FIRST_CYCLES, UNPREPARED_FACTOR = 3.0, 3.0
"""Cycles in a record, where one without a preparation errs so many times as much."""
LEAST_MOTION_SHARE = 0.03
"""Share of a record's motion that lies in a band, for the record to tell of that band."""
LARGEST_MISSED_SHARE = 0.1
"""Share of that motion that may have been missed: more is the slow rest's, not a small signal's."""
SMALLEST = 1e-15
"""m; added to a motion, so that a record at rest has a logarithm."""


@frozen(eq=False)
class DetectionLimit:
    """Rms (n,) in m that is no effect, in n bands between n + 1 ``edges`` (Hz).

    ``noise`` (n,) is the sensor's part of it.
    """

    edges: tuple[float, ...] = field(converter=floats)
    rms: Array
    noise: Array

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

        The scanner's rest is not quite the model's depolarised one, and the first large move takes
        it away: a step that no scan shows, which is prepared by such moves. It lies in the bands
        of the record's first few cycles.
        """
        stepped = np.array(self.edges[:-1]) < FIRST_CYCLES / duration
        return evolve(self, rms=np.where(stepped, UNPREPARED_FACTOR, 1.0) * self.rms)

    def sampled(self, sample_period: float) -> "DetectionLimit":
        """Detection limit of the same record at a longer sample period (s), noise folded."""
        nyquist = 0.5 / sample_period
        edges = np.array([*(edge for edge in self.edges if edge < nyquist), nyquist])
        error = np.sqrt(np.maximum(self.rms**2 - self.noise**2, 0.0))[: len(edges) - 1]
        noise = _white(float(np.linalg.norm(self.noise)), edges)
        return DetectionLimit(edges, np.hypot(error, noise), noise)

    def weights(self, count: int, sample_period: float) -> Array:
        """Weights of a signal's coefficients by which each band counts in units of its floor."""
        return spread(1.0 / self.rms, self.edges, count, sample_period)


def detection_limit(
    known: Sequence[ModelDiscrepancy], displacement: Array, sample_period: float
) -> DetectionLimit:
    """Detection limit of a record of ``displacement`` (n,) in m under a model of ``known`` errors.

    The first of them is that of fresh data. Those that moved in a band too, at other amplitudes,
    are interpolated between. By half of what a slow motion errs by in a band it may err in the
    next as well, be it the first in which stages vibrate: a hysteresis that is not quite the
    model's has harmonics, at whatever rate it is driven, and the model discrepancy's record was
    driven at
    others. From ``VIBRATING`` Hz on the largest share counts: a model errs there by modes that it
    lacks, which not every drive strikes.
    """
    edges = np.array(band_edges(sample_period))
    moved = rms_by_band(displacement, edges, sample_period)
    parts = [_BandDiscrepancy.of(each, edges) for each in known]
    error = np.array([_interpolated(parts, moved, band) for band in range(len(moved))])
    shares = np.array([part.rms / part.displacement for part in parts])
    vibrating = edges[:-1] >= VIBRATING
    slow = np.where(vibrating, 0.0, error)
    error = np.maximum(error, _harmonics(slow, moved, shares[0]))
    error[vibrating] = np.maximum(error, MISSED_FACTOR * shares.max(axis=0) * moved)[vibrating]
    noise = _white(float(np.linalg.norm(known[0].noise)), edges)
    return DetectionLimit(edges, np.hypot(error, noise), noise)


def _white(rms: float, edges: Array) -> Array:
    """Rms of white noise in the bands (n,) between n + 1 edges, of its rms in all."""
    return np.asarray(rms * np.sqrt(np.diff(edges) / edges[-1]))


def _harmonics(error: Array, moved: Array, shares: Array) -> Array:
    """Error (bands,) in m that harmonics of the motion in the band below may come to.

    ``error`` (bands,) in m is what slow motions err by, 0 where stages vibrate. Of the first
    band's error most is creep's and drift's, which have none: there it is as much as the second's
    share of that motion.
    """
    harmonics = HARMONIC_SHARE * np.append(0.0, error[:-1])
    harmonics[1:2] = moved[:1] * shares[1:2]
    return harmonics


@frozen(eq=False)
class _BandDiscrepancy:
    """A model discrepancy in a record's bands: ``rms`` and ``displacement`` (bands,) in m."""

    rms: Array
    displacement: Array
    amplitude: float

    @classmethod
    def of(cls, known: ModelDiscrepancy, edges: Array) -> "_BandDiscrepancy":
        centres = 0.5 * (edges[1:] + edges[:-1])
        band = np.clip(np.searchsorted(known.bands, centres) - 1, 0, len(known.rms) - 1)
        rms, displacement = np.array(known.rms)[band], np.array(known.displacement)[band]
        amplitude = float(np.linalg.norm(known.displacement))
        return cls(rms, np.maximum(displacement, SMALLEST), max(amplitude, SMALLEST))

    def tells(self, band: int) -> bool:
        """Whether the record moved in a band, and was predicted there but for a small part."""
        moved = self.displacement[band]
        return bool(
            moved > LEAST_MOTION_SHARE * self.amplitude
            and self.rms[band] < LARGEST_MISSED_SHARE * moved
        )

    def error(self, moved: Array, band: int) -> float:
        """Rms error (m) in a band of a motion of ``moved`` (bands,) in m."""
        whole = np.linalg.norm(moved) / self.amplitude
        return float(self.rms[band] * max(moved[band] / self.displacement[band], whole))


def _interpolated(parts: Sequence[_BandDiscrepancy], moved: Array, band: int) -> float:
    """Error in a band by the amplitude of the motion, between the records that moved in it."""
    telling = [part for part in parts[1:] if part.tells(band)]
    telling = sorted([parts[0], *telling], key=lambda part: part.amplitude)
    here = np.log(np.linalg.norm(moved) + SMALLEST)
    amplitudes = np.log([part.amplitude for part in telling])
    return float(np.interp(here, amplitudes, [part.error(moved, band) for part in telling]))


FINER = 4
"""Levels for one of the table: a sixteenth of a corner is left."""
CUBIC_ORDER = 3


@frozen(eq=False)
class _ForwardHysteresis(EverettSurface):
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
    order = min(CUBIC_ORDER, last)
    spline = RectBivariateSpline(levels, levels, below - below.T, kx=order, ky=order)
    values = np.tril(spline(finer, finer), k=-1)
    return _ForwardHysteresis(surface.lower, surface.upper, values, surface.offset)


def error_between_levels(playback: Playback, chain: Chain) -> Array:
    """Displacement (n,) in m with the table of a chain's model less that with the smooth surface.

    Whatever else the chain's hysteresis does, the table's corners are those of Preisach's.
    """
    chain = evolve(chain, hysteresis=RATE_INDEPENDENT)
    hysteresis = chain.model.hysteresis
    rounded = evolve(hysteresis, forward=smooth(hysteresis.forward))
    other = evolve(chain, model=evolve(chain.model, hysteresis=rounded))
    afresh = Playback(playback.view, playback.initial_state)
    return playback.displacement(chain) - afresh.displacement(other)


POINTS = 200
"""Frequencies in a band: a resonance is a few Hz wide."""


def with_moved_resonance(
    floor: DetectionLimit, stage: VibrationModel, now: VibrationModel
) -> Array:
    """Detection limit (bands,) in m of a model of ``stage`` whose vibration is now ``now``.

    It rises as the gain does, from the band on in which stages vibrate, and to no more than the
    loudest of these bands has without the effect.
    """
    if now == stage:
        return floor.rms
    edges = np.array(floor.edges)
    louder = np.clip(_gains(now, edges) / _gains(stage, edges), 1.0, None)
    vibrating = edges[:-1] >= VIBRATING
    loudest = floor.rms[vibrating].max(initial=0.0)
    moved = np.clip(louder * floor.rms, floor.rms, np.maximum(floor.rms, loudest))
    return np.where(vibrating, moved, floor.rms)


def _gains(stage: VibrationModel, edges: Array) -> Array:
    """Rms gain in each band (bands,), relative to that at rest."""
    omega = 2.0 * np.pi * np.array([np.linspace(*band, POINTS) for band in pairwise(edges)])
    power = np.mean(np.abs(stage.response(omega)) ** 2, axis=1)
    return np.asarray(np.sqrt(power) / stage.static_gain)
