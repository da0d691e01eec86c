"""Models of which the error is known from motion at one rate alone.

At one rate the loops of a lag, a delay or viscous domains are those of a hysteresis that is wider:
one identified there has taken up of them what it can, and hides them or has them pass for another
effect. Motion at several rates tells (Mayergoyz, Mathematical Models of Hysteresis, 1991).
"""

from collections.abc import Sequence

import numpy as np

from afm_scan_ros.core.known_error import KnownError

MOVED = 0.2
"""Share of a record's largest displacement in a band from which on the record moved in it: the
harmonics of a triangle, the largest of which has a ninth, are no further rate."""
SEVERAL = 10.0
"""Ratio of the highest to the lowest frequency of the motion that counts as several rates."""


def one_rate(known: Sequence[KnownError]) -> tuple[float, float] | None:
    """Band (Hz) of the only rate at which a model's error is known; None where it is of several.

    None too where nothing is known, or where what is known did not move.
    """
    moved = [band for record in known for band in _moved(record)]
    if not moved:
        return None
    low, high = min(low for low, _ in moved), max(high for _, high in moved)
    return None if high >= SEVERAL * min(end for _, end in moved) else (low, high)


def _moved(record: KnownError) -> list[tuple[float, float]]:
    """Bands (Hz) in which a record moved."""
    size = np.array(record.displacement)
    places = np.flatnonzero((size > 0.0) & (size >= MOVED * size.max()))
    return [(record.bands[i], record.bands[i + 1]) for i in places]
