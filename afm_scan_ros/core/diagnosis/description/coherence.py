"""What share of a residual goes linearly with a signal, by band of frequency."""

from collections.abc import Sequence

import numpy as np
from attrs import field, frozen
from scipy.signal import csd, welch

from afm_scan_ros.core.effects.coefficients import coefficients
from afm_scan_ros.core.types import Array

SEGMENTS = 16
"""A record is cut into so many, half overlapping."""
CHANCE = 0.05


@frozen(eq=False)
class Coherence:
    """Coherence, 0 to 1, in n bands between n + 1 ``edges`` (Hz), weighted by the residual's power.

    A band narrower than a line of the spectrum has NaN. Two unrelated signals exceed ``chance``
    in one line of twenty. A scan repeats itself, and all that repeats with it coheres with it.
    """

    edges: tuple[float, ...] = field(converter=coefficients)
    values: Array
    chance: float


def coherence(
    residual: Array, signal: Array, sample_period: float, edges: Sequence[float]
) -> Coherence:
    """Coherence of a residual (n,) with a signal (n,)."""
    options = {"fs": 1.0 / sample_period, "nperseg": 2 * len(residual) // (SEGMENTS + 1)}
    frequency, own = welch(residual, **options)
    power = welch(signal, **options)[1]
    cross = np.abs(csd(residual, signal, **options)[1]) ** 2
    shared = cross / np.maximum(power, np.finfo(float).tiny)
    band = np.clip(np.searchsorted(edges, frequency, "right") - 1, 0, len(edges) - 2)
    sums = [np.bincount(band, of, len(edges) - 1) for of in (shared, own)]
    with np.errstate(invalid="ignore", divide="ignore"):
        values = np.where(sums[1] > 0.0, sums[0] / sums[1], np.nan)
    return Coherence(tuple(edges), values, float(1.0 - CHANCE ** (1.0 / (SEGMENTS - 1))))
