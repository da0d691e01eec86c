"""The floor of a residual: what is left of a record although nothing is missing in the model.

It is the sensor's noise and the error that is known of the model, band by band. A validation
record says how large that error is beside the motion in its band, and beside all motion, for a
slow motion errs at higher frequencies too (a hysteresis that is not quite the model's has
harmonics); the larger of the two counts.
"""

from collections.abc import Sequence

import numpy as np
from attrs import evolve, field, frozen

from afm_scan_ros.core.bands import rms_by_band, spread
from afm_scan_ros.core.effects.coefficients import coefficients
from afm_scan_ros.core.known_error import KnownError, band_edges
from afm_scan_ros.core.types import Array

AT_FLOOR = 1.8
"""Largest ratio of a band's rms to its floor at which nothing is missing, and none is sought."""
VIBRATING, MISSED = 300.0, 1.5
"""Hz from which a model errs by the modes that it lacks, and by how many times the share known."""
HARMONICS = 0.5
"""Share of a slow motion's error that its harmonics may come to, in the band above it."""
FIRST_CYCLES, UNPREPARED = 3.0, 3.0
"""Cycles in a record, where one without a preparation errs so many times as much."""
TELLING = 0.03
"""Share of a record's motion that lies in a band, for the record to tell of that band."""
FORETOLD = 0.1
"""Share of that motion that may have been missed: more is the slow rest's, not a small signal's."""
SMALLEST = 1e-15
"""m; added to a motion, so that a record at rest has a logarithm."""


@frozen(eq=False)
class Floor:
    """Rms (n,) in m that is no effect, in n bands between n + 1 ``edges`` (Hz).

    ``noise`` (n,) is the sensor's part of it.
    """

    edges: tuple[float, ...] = field(converter=coefficients)
    rms: Array
    noise: Array

    @property
    def total(self) -> float:
        """Rms over all bands, m."""
        return float(np.linalg.norm(self.rms))

    def at_least(self, error: Array) -> "Floor":
        """Floor in which an rms error (bands,) in m that is foretold of the record has room.

        The known error's record held such a part too, so the larger of the two counts.
        """
        return evolve(self, rms=np.maximum(self.rms, error))

    def unprepared(self, duration: float) -> "Floor":
        """Floor of a record of some length (s) that did not begin with a preparation.

        The scanner's rest is not quite the model's depolarised one, and the first large move takes
        it away: a step that no scan shows, which is prepared by such moves. It lies in the bands
        of the record's first few cycles.
        """
        stepped = np.array(self.edges[:-1]) < FIRST_CYCLES / duration
        return evolve(self, rms=np.where(stepped, UNPREPARED, 1.0) * self.rms)

    def sampled(self, sample_period: float) -> "Floor":
        """Floor of the same record sampled less often (s), its noise folded into fewer bands."""
        nyquist = 0.5 / sample_period
        edges = np.array([*(edge for edge in self.edges if edge < nyquist), nyquist])
        error = np.sqrt(np.maximum(self.rms**2 - self.noise**2, 0.0))[: len(edges) - 1]
        noise = _white(float(np.linalg.norm(self.noise)), edges)
        return Floor(edges, np.hypot(error, noise), noise)

    def weights(self, count: int, sample_period: float) -> Array:
        """Weights of a signal's coefficients by which each band counts in units of its floor."""
        return spread(1.0 / self.rms, self.edges, count, sample_period)


def floor_of(known: Sequence[KnownError], displacement: Array, sample_period: float) -> Floor:
    """Floor of a record of ``displacement`` (n,) in m under a model of ``known`` errors.

    The first of them is that of fresh data. Those that moved in a band too, at other amplitudes,
    are interpolated between. By half of what a slow motion errs by in a band it may err in the
    next as well, be it the first in which stages vibrate: a hysteresis that is not quite the
    model's has harmonics, at whatever rate it is driven, and the known error's record was driven at
    others. From ``VIBRATING`` Hz on the largest share counts: a model errs there by modes that it
    lacks, which not every drive strikes.
    """
    edges = np.array(band_edges(sample_period))
    moved = rms_by_band(displacement, edges, sample_period)
    parts = [_Known.of(each, edges) for each in known]
    error = np.array([_interpolated(parts, moved, band) for band in range(len(moved))])
    shares = np.array([part.rms / part.displacement for part in parts])
    vibrating = edges[:-1] >= VIBRATING
    slow = np.where(vibrating, 0.0, error)
    error = np.maximum(error, _harmonics(slow, moved, shares[0]))
    error[vibrating] = np.maximum(error, MISSED * shares.max(axis=0) * moved)[vibrating]
    noise = _white(float(np.linalg.norm(known[0].noise)), edges)
    return Floor(edges, np.hypot(error, noise), noise)


def _white(rms: float, edges: Array) -> Array:
    """Rms of white noise in the bands (n,) between n + 1 edges, of its rms in all."""
    return np.asarray(rms * np.sqrt(np.diff(edges) / edges[-1]))


def _harmonics(error: Array, moved: Array, shares: Array) -> Array:
    """Error (bands,) in m that harmonics of the motion in the band below may come to.

    ``error`` (bands,) in m is what slow motions err by, 0 where stages vibrate. Of the first
    band's error most is creep's and drift's, which have none: there it is as much as the second's
    share of that motion.
    """
    harmonics = HARMONICS * np.append(0.0, error[:-1])
    harmonics[1:2] = moved[:1] * shares[1:2]
    return harmonics


@frozen(eq=False)
class _Known:
    """A known error in a record's bands: ``rms`` and ``displacement`` (bands,) in m."""

    rms: Array
    displacement: Array
    amplitude: float

    @classmethod
    def of(cls, known: KnownError, edges: Array) -> "_Known":
        centres = 0.5 * (edges[1:] + edges[:-1])
        band = np.clip(np.searchsorted(known.bands, centres) - 1, 0, len(known.rms) - 1)
        rms, displacement = np.array(known.rms)[band], np.array(known.displacement)[band]
        amplitude = float(np.linalg.norm(known.displacement))
        return cls(rms, np.maximum(displacement, SMALLEST), max(amplitude, SMALLEST))

    def tells(self, band: int) -> bool:
        """Whether the record moved in a band, and was predicted there but for a small part."""
        moved = self.displacement[band]
        return bool(moved > TELLING * self.amplitude and self.rms[band] < FORETOLD * moved)

    def error(self, moved: Array, band: int) -> float:
        """Rms error (m) in a band of a motion of ``moved`` (bands,) in m."""
        whole = np.linalg.norm(moved) / self.amplitude
        return float(self.rms[band] * max(moved[band] / self.displacement[band], whole))


def _interpolated(parts: Sequence[_Known], moved: Array, band: int) -> float:
    """Error in a band by the amplitude of the motion, between the records that moved in it."""
    telling = [part for part in parts[1:] if part.tells(band)]
    telling = sorted([parts[0], *telling], key=lambda part: part.amplitude)
    here = np.log(np.linalg.norm(moved) + SMALLEST)
    amplitudes = np.log([part.amplitude for part in telling])
    return float(np.interp(here, amplitudes, [part.error(moved, band) for part in telling]))
