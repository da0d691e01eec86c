"""The floor of a residual: what is left of a record although nothing is missing in the model.

It is the sensor's noise and the error that is known of the model, band by band. A validation
record says how large that error is beside the motion in its band, and beside all motion, for a
slow motion errs at higher frequencies too (a hysteresis that is not quite the model's has
harmonics); the larger of the two counts.
"""

import numpy as np
from attrs import field, frozen

from afm_scan_ros.core.effects.coefficients import coefficients
from afm_scan_ros.core.known_error import KnownError, band_edges
from afm_scan_ros.core.tracing.bands import rms_by_band, spread
from afm_scan_ros.core.types import Array


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


def floor_of(known: KnownError, displacement: Array, sample_period: float) -> Floor:
    """Floor of a record of ``displacement`` (n,) in m under a model of ``known`` error."""
    edges = np.array(band_edges(sample_period))
    centres = 0.5 * (edges[1:] + edges[:-1])
    band = np.clip(np.searchsorted(known.bands, centres) - 1, 0, len(known.rms) - 1)
    error, reference = np.array(known.rms), np.array(known.displacement)
    moved = rms_by_band(displacement, edges, sample_period)
    share = np.maximum(moved / reference[band], np.linalg.norm(moved) / np.linalg.norm(reference))
    noise = np.linalg.norm(known.noise) * np.sqrt(np.diff(edges) / edges[-1])
    return Floor(edges, np.hypot(error[band] * share, noise), noise)
