"""Smooth transitions from 0 to 1 and from 1 to 0, used by all trajectories."""

from math import pi

import numpy as np

from afm_scan_ros.core.types import Array


def smooth_step(s: Array) -> Array:
    """Rise from 0 (s <= 0) to 1 (s >= 1) with least jerk, at rest at both ends.

    The quintic of Flash and Hogan (1985); velocity and acceleration are zero at both ends.
    """
    s = s.clip(0.0, 1.0)
    near = np.minimum(s, 1.0 - s)
    return _from_both_ends(s, near * near * near * (10.0 + near * (6.0 * near - 15.0)))


def soft_ramp(s: Array, share: float) -> Array:
    """Rise from 0 (s <= 0) to 1 (s >= 1) at constant speed, but for both ends.

    ``share`` in [0, 1] of the rise is spent accelerating and braking, one half at each end, each
    with one half of a Hann-shaped (sin squared) pulse of acceleration; 0 leaves sharp corners.
    """
    s = s.clip(0.0, 1.0)
    return _from_both_ends(s, _from_corner(np.minimum(s, 1.0 - s), share))


def _from_both_ends(s: Array, near: Array) -> Array:
    """Mirror what is known near an end, so that rounding never goes beyond 1."""
    return np.where(s <= 0.5, near, 1.0 - near)  # noqa: PLR2004 - a half


def _from_corner(s: Array, share: float) -> Array:
    """Way done at ``s`` in [0, 1/2] after a corner, where the acceleration pulse has its peak."""
    speed = 1.0 / (1.0 - share * (0.5 - 2.0 / pi**2))
    steady = speed * (s - share * (0.25 - 1.0 / pi**2))
    if share == 0.0:
        return steady
    phase = 2.0 * pi * np.minimum(s / share, 0.5)
    turning = speed * share / (2.0 * pi**2) * (0.5 * phase * phase + 1.0 - np.cos(phase))
    return np.where(s < 0.5 * share, turning, steady)
