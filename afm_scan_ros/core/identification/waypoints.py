"""Smooth motion from level to level."""

import numpy as np
from attrs import frozen

from afm_scan_ros.core.types import Array


@frozen(eq=False)
class Waypoints:
    """Smooth motion from level to level, each taking its time, with a pause of zero distance.

    ``samples[i]`` is when ``levels[i]`` is reached. The speed of a move rises and falls as a
    half cosine over ``blend`` samples (half the move where that is shorter) and is constant
    between, so the resonance is not struck at the corners.
    """

    sample_period: float
    levels: Array
    samples: Array
    blend: float

    @property
    def total_samples(self) -> int:
        """Samples from rest to rest."""
        return int(self.samples[-1]) + 1

    def voltage(self, samples: Array) -> Array:
        """Drive in V at the sample indices given, shape (n,)."""
        move = np.clip(np.searchsorted(self.samples, samples, "right") - 1, 0, len(self.levels) - 2)
        start, length = self.samples[move], np.diff(self.samples)[move]
        share = _smooth_share(samples - start, length, np.minimum(self.blend, length / 2))
        return np.asarray(self.levels[move] + share * np.diff(self.levels)[move])


def _smooth_share(elapsed: Array, length: Array, blend: Array) -> Array:
    """Share of a move that is done, 0 to 1, its speed rising and falling over ``blend``."""
    mirrored = elapsed > length / 2
    near = np.where(mirrored, length - elapsed, elapsed)
    rising = np.minimum(near, blend)
    path = rising / 2 - blend / (2 * np.pi) * np.sin(np.pi * rising / blend) + (near - rising)
    share: Array = path / (length - blend)
    return np.where(mirrored, 1.0 - share, share)
