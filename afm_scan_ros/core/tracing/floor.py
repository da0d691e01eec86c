"""The floor of a residual: what is left of a record although nothing is missing in the model.

It is the sensor's noise and the error that is known of the model, band by band. A validation
record says how large that error is beside the motion in its band, and beside all motion, for a
slow motion errs at higher frequencies too (a hysteresis that is not quite the model's has
harmonics); the larger of the two counts.
"""

from collections.abc import Sequence

import numpy as np
from attrs import field, frozen

from afm_scan_ros.core.effects.coefficients import coefficients
from afm_scan_ros.core.known_error import KnownError, band_edges
from afm_scan_ros.core.tracing.bands import rms_by_band, spread
from afm_scan_ros.core.types import Array

VIBRATING = 300.0
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

    def weights(self, count: int, sample_period: float) -> Array:
        """Weights of a signal's coefficients by which each band counts in units of its floor."""
        return spread(1.0 / self.rms, self.edges, count, sample_period)


def floor_of(known: Sequence[KnownError], displacement: Array, sample_period: float) -> Floor:
    """Floor of a record of ``displacement`` (n,) in m under a model of ``known`` errors.

    Between records of unlike amplitude the error is interpolated; from ``VIBRATING`` Hz on, the
    largest share counts, for it is by missing modes that a model errs there.
    """
    edges = np.array(band_edges(sample_period))
    moved = rms_by_band(displacement, edges, sample_period)
    by_amplitude = sorted(known, key=_amplitude)
    errors = np.array([_error(each, edges, moved) for each in by_amplitude])
    motion = np.log([_amplitude(each) for each in by_amplitude])
    here = np.log(np.linalg.norm(moved) + SMALLEST)
    error = np.array([np.interp(here, motion, of_band) for of_band in errors.T])
    near = motion > here - np.log(10.0)
    if near.any():
        vibrating = edges[:-1] >= VIBRATING
        error[vibrating] = np.maximum(error, errors[near].max(axis=0))[vibrating]
    noise = np.linalg.norm(known[0].noise) * np.sqrt(np.diff(edges) / edges[-1])
    return Floor(edges, np.hypot(error, noise), noise)


def _error(known: KnownError, edges: Array, moved: Array) -> Array:
    """Rms error of the model (bands,) in m for a motion of ``moved`` (bands,)."""
    centres = 0.5 * (edges[1:] + edges[:-1])
    band = np.clip(np.searchsorted(known.bands, centres) - 1, 0, len(known.rms) - 1)
    whole = np.linalg.norm(moved) / _amplitude(known)
    share = np.maximum(moved / np.array(known.displacement)[band], whole)
    return np.asarray(np.array(known.rms)[band] * share)


def _amplitude(known: KnownError) -> float:
    return float(np.linalg.norm(known.displacement))
