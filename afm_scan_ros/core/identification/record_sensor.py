"""A sensor that stands still while the scanner moves: at its rail, or because nobody read it.

A reading lasts for as long as the motion takes from it to the next, noise apart. At turning points
it lasts some three times as long as the readings about it, and never eight times.
"""

from collections.abc import Iterator

import numpy as np
from attrs import frozen
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from afm_scan_ros.core.types import Array

SHORTEST = 16
"""Samples in succession of one value, fewer than which tell nothing."""
LONGER = 8
"""How many times longer than the readings about it none lasts."""
ABOUT = 8
"""Readings before and after one that are about it."""
VISIBLE = 0.5
"""Share of the readings at rest that equal the one before, beyond which noise does not show."""
FEWEST = 100
"""Samples at rest, fewer than which do not say whether noise shows."""


@frozen(eq=False)
class Runs:
    """Samples in succession of one value: ``first`` sample, ``length``, ``value`` (m), all (n,)."""

    first: NDArray[np.int64]
    length: NDArray[np.int64]
    value: Array

    @classmethod
    def of(cls, displacement: Array) -> "Runs":
        """Cut a displacement (m), (n,), where it changes."""
        first = np.concatenate([[0], np.flatnonzero(np.diff(displacement)) + 1])
        return cls(first, np.diff(np.append(first, len(displacement))), displacement[first])

    def standing(self) -> NDArray[np.int64]:
        """Return which of the runs last too long for motion."""
        long = np.flatnonzero(self.length >= SHORTEST)
        windows = sliding_window_view(np.pad(self.length, ABOUT), 2 * ABOUT + 1)[long].copy()
        windows[:, ABOUT] = 0
        return np.asarray(long[self.length[long] > LONGER * windows.max(axis=1)])


def sensor_problems(axis: str, drive: Array, displacement: Array) -> Iterator[str]:
    """Yield where a displacement (m) stands still under a drive (V), both (n,), of an axis.

    Where noise does not show, a rest of the drive may leave it still, and between the rails it
    dwells as the quanta lie.
    """
    runs = Runs.of(displacement)
    standing = runs.standing()
    rails = {"lower": displacement.min(), "upper": displacement.max()}
    if not _noise_shows(drive, displacement):
        standing = standing[np.isin(runs.value[standing], [*rails.values()])]
        standing = standing[_moved_throughout(drive, runs, standing)]
    for run in standing[np.argsort(-runs.length[standing])]:
        yield _standing(axis, runs.first[run], runs.length[run], runs.value[run], rails)


def _standing(axis: str, first: int, length: int, value: float, rails: dict[str, float]) -> str:
    for end, rail in rails.items():
        if value == rail:
            return (
                f"displacement {axis} is clipped at its {end} end, {value:.4g} m, for {length}"
                f" samples from sample {first}; record it with less drive or a wider sensor range"
            )
    return (
        f"displacement {axis} stands still at {value:.4g} m for {length} samples from sample"
        f" {first}: the sensor was not read; record it again, without a gap"
    )


def _noise_shows(drive: Array, displacement: Array) -> bool:
    """Whether the readings change while the drive rests."""
    resting = np.diff(drive) == 0.0
    if np.count_nonzero(resting) < FEWEST:
        return False
    return bool(np.mean(np.diff(displacement)[resting] == 0.0) < VISIBLE)


def _moved_throughout(drive: Array, runs: Runs, chosen: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Return in which of the runs chosen the drive never rests."""
    rests = np.append(0, np.cumsum(np.diff(drive, append=drive[-1]) == 0.0))
    first = runs.first[chosen]
    return np.asarray(rests[first + runs.length[chosen] - 1] == rests[first])
