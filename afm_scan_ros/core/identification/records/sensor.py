"""A sensor that stands still while the scanner moves: at its rail, or because nobody read it."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.special import erf

from afm_scan_ros.core.types import Array

SHORTEST = 16
"""Samples of one value, fewer than which show nothing."""
OFTENER = 6
"""How many times as often as the values next to it an extreme is never read: at turns, thrice."""
NEXT = 8
"""Values that are next to an extreme."""
VISIBLE = 0.5
"""Share of the readings at rest that equal the one before, beyond which noise does not show."""
FEWEST = 100
"""Samples at rest, fewer than which do not show whether there is noise."""
BEYOND_CHANCE = 2.0
"""Length of a run of one value over the longest that noise leaves to chance."""


def sensor_problems(axis: str, drive: Array, displacement: Array) -> Iterator[str]:
    """Yield where a displacement (m) stands still under a drive (V), both (n,), of an axis.

    Where noise does not show, it may do so for as long as the drive rests.
    """
    equal = _equal_at_rest(drive, displacement)
    shows = equal < VISIBLE
    moving = np.append(np.diff(drive) != 0.0, False) | shows
    yield from _clipped(axis, displacement, moving)
    if shows:
        yield from _unread(axis, displacement, equal)


def _clipped(axis: str, displacement: Array, moving: NDArray[np.bool_]) -> Iterator[str]:
    """Find an extreme that is read again and again, the values next to it but now and then."""
    values, counts = np.unique(displacement[moving], return_counts=True)
    if len(values) <= NEXT:
        return
    ends = {"lower": (0, counts[1 : NEXT + 1]), "upper": (-1, counts[-NEXT - 1 : -1])}
    for end, (rail, others) in ends.items():
        if counts[rail] >= SHORTEST and counts[rail] > OFTENER * others.max():
            first = int(np.argmax(displacement == values[rail]))
            yield (
                f"displacement {axis} is clipped at its {end} end, {values[rail]:.4g} m, in"
                f" {counts[rail]} samples from sample {first} on; record it with less drive or a"
                " wider sensor range"
            )


def _unread(axis: str, displacement: Array, equal: float) -> Iterator[str]:
    """Find the longest run of one reading, where noise repeats one with probability ``equal``.

    That is the mean over all places of rest: q / (2 √π s), for normal noise of rms s and steps of q
    of the sensor. Midway of a step the same is read with probability erf(q / (2 √2 s)).
    """
    edges = np.concatenate([[0], np.flatnonzero(np.diff(displacement)) + 1, [len(displacement)]])
    longest = int(np.argmax(np.diff(edges)))
    first, length = edges[longest], np.diff(edges)[longest]
    midway = erf(np.sqrt(np.pi / 2.0) * max(equal, 1.0 / len(displacement)))
    chance = np.log(len(displacement)) / -np.log(midway)
    if length > max(SHORTEST, BEYOND_CHANCE * chance):
        yield (
            f"displacement {axis} stands still at {displacement[first]:.4g} m for {length} samples"
            f" from sample {first}: the sensor was not read; record it again, without a gap"
        )


def _equal_at_rest(drive: Array, displacement: Array) -> float:
    """Share of the readings that equal the one before while the drive rests; 1 if unknown."""
    resting = np.diff(drive) == 0.0
    if np.count_nonzero(resting) < FEWEST:
        return 1.0
    return float(np.mean(np.diff(displacement)[resting] == 0.0))
