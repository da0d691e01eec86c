"""A signal that a loop gives back unchanged, found in rounds of which the last ones are mixed.

Anderson, Iterative procedures for nonlinear integral equations, Journal of the ACM 12 (1965)
547-560.
"""

from collections.abc import Callable, Sequence

import numpy as np

from afm_scan_ros.core.errors import ScanError
from afm_scan_ros.core.types import Array

ROUNDS = 200
DEPTH = 20
"""Rounds that are mixed."""
BEYOND = 1e3
"""Of the first signal, from which one will not settle."""
SETTLED = 1e-6
"""Change of the signal in a round, over its rms, below which it is found."""


def fixed_point(change: Callable[[Array], Array], start: Array, what: str) -> Array:
    """Return the signal that has no ``change``, from a start.

    Raises ScanError, naming ``what`` is done, where none is found.
    """
    signals, changes = [start], [change(start)]
    bound = BEYOND * np.abs(start).max()
    while np.linalg.norm(changes[-1]) > SETTLED * np.linalg.norm(signals[-1]):
        following = _mixed(signals[-DEPTH:], changes[-DEPTH:])
        if len(changes) == ROUNDS or not np.abs(following).max() <= bound:
            raise ScanError(
                f"{what}: not settled in {len(changes)} rounds: the motion is beyond the amplitudes"
                " for which the model was identified; move less, or identify it there too"
            )
        signals.append(following)
        changes.append(change(following))
    return np.asarray(signals[-1] + changes[-1])


def _mixed(signals: Sequence[Array], changes: Sequence[Array]) -> Array:
    """Return the next signal: were the loop linear, the one of the least change."""
    flat = np.stack([change.ravel() for change in changes])
    slopes = np.diff(flat, axis=0)
    weights = np.linalg.lstsq(slopes.T, flat[-1], rcond=None)[0] if len(slopes) else np.zeros(0)
    moved = np.diff(np.stack(signals), axis=0) + slopes.reshape(-1, *changes[-1].shape)
    return np.asarray(signals[-1] + changes[-1] - np.tensordot(weights, moved, axes=1))
