"""A creep record → its steps, and what was measured while the drive held still after each.

Long holds are averaged before a fit, over stretches that grow with the time since the step. The
model is averaged over the same stretches, exactly, so a fit is not biased; for white noise the mean
of a stretch, weighed by its samples, has the likelihood of the samples, but for what the model
changes by within a stretch, which is a thousandth.
"""

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
from attrs import evolve, frozen
from numpy.typing import NDArray

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import Array

SETTLING = 0.3
"""Seconds after a move that are left out: the vibration dies there."""
PER_DECADE = 40
"""Averages in each decade of the time since the step."""
MANY = 12
"""Levels of a drive that steps up and down, beyond which it scans."""
SHORTEST, FEWEST = 10.0, 100
"""Seconds and samples that the first step must be held for: else no element is identified."""


@frozen(eq=False)
class CreepStep:
    """A move of the drive by ``height`` V, the hold's level reached at sample ``reached``.

    ``share`` (m,) is the part of it that is done at each of the m samples before.
    """

    height: float
    share: Array
    reached: int

    def made(self, first: Array) -> Array:
        """1 where a stretch of a hold, from sample ``first``, lies after the step, else 0."""
        return np.where(first >= self.reached, 1.0, 0.0)

    def lagged(self, first: Array, count: Array, rate: float) -> Array:
        """1/(1 + s τ) of the step, ``rate`` being T/τ, averaged over ``count`` from ``first``.

        The drive is held between samples, and sampled just before each update.
        """
        done = -np.expm1(-rate) * self.share @ np.exp(-rate * np.arange(len(self.share))[::-1])
        since = np.maximum(first - self.reached, 0.0)
        decay = np.exp(-rate * since) * np.expm1(-rate * count) / (count * np.expm1(-rate))
        return np.where(first >= self.reached, 1.0 - (1.0 - done) * decay, 0.0)


@frozen(eq=False)
class CreepRecord:
    """Stretches of held drive: ``displacement`` (m), a mean over ``count`` samples from ``first``.

    All (n,); ``hold`` numbers the hold each lies in, 0 being the rest before ``steps[0]``.
    """

    sample_period: float
    steps: tuple[CreepStep, ...]
    hold: NDArray[np.int64]
    first: Array
    count: Array
    displacement: Array

    def where(self, chosen: NDArray[np.bool_]) -> "CreepRecord":
        """Return the stretches chosen, and the steps before the last of them."""
        hold = self.hold[chosen]
        return evolve(
            self,
            steps=self.steps[: hold.max()],
            hold=hold,
            first=self.first[chosen],
            count=self.count[chosen],
            displacement=self.displacement[chosen],
        )

    def averaged(self) -> "CreepRecord":
        """Return a record of single samples as averages over stretches."""
        edges = np.concatenate([self._edges(hold) for hold in np.unique(self.hold)])
        count = np.diff(np.append(edges, len(self.hold)))
        mean = np.add.reduceat(self.displacement, edges) / count
        return evolve(
            self,
            hold=self.hold[edges],
            first=self.first[edges],
            count=count.astype(np.float64),
            displacement=mean,
        )

    def _edges(self, hold: int) -> NDArray[np.int64]:
        begin, end = np.searchsorted(self.hold, [hold, hold + 1])
        reached = self.steps[hold - 1].reached if hold else 0
        since = self.first[begin:end] - reached + 1.0
        decades = np.floor(PER_DECADE * np.log10(since))
        return np.asarray(begin + np.flatnonzero(np.diff(decades, prepend=-1.0)), dtype=np.int64)

    @property
    def noise(self) -> float:
        """Noise of a single sample, rms, m: what varies from each sample to the next."""
        together = np.diff(self.hold) == 0
        return float(np.sqrt(np.mean(np.diff(self.displacement)[together] ** 2) / 2.0))

    @property
    def longest(self) -> float:
        """Longest time after a step, s."""
        last = self.first + self.count
        reached = np.array([0, *(step.reached for step in self.steps)])
        return float(np.max(last - reached[self.hold])) * self.sample_period


def creep_record(drive: Array, displacement: Array, sample_period: float) -> CreepRecord:
    """Find the holds of a drive (V), with the displacement (m) measured there, both (n,).

    Raises InputError unless the drive rests, steps and holds still long enough.
    """
    spans = list(_holds(drive, sample_period))
    if len(spans) < 2:  # noqa: PLR2004 - the rest and a hold
        raise InputError(
            f"creep record: the drive holds still {len(spans)} times for longer than"
            f" {2 * SETTLING} s; rest, step and hold are needed"
        )
    _refuse_short(spans[1][1] - spans[1][0], sample_period)
    settling = max(1, int(np.ceil(SETTLING / sample_period)))
    moves = pairwise(spans)
    steps = tuple(_step(drive[end - 1 : start + 1], start) for (_, end), (start, _) in moves)
    first = np.concatenate([np.arange(start + settling, end) for start, end in spans])
    hold = np.concatenate(
        [np.full(end - start - settling, i) for i, (start, end) in enumerate(spans)]
    )
    held = displacement[first]
    return CreepRecord(sample_period, steps, hold, first.astype(float), np.ones(len(held)), held)


def rests_briefly(drive: Array, sample_period: float) -> bool:
    """Whether a drive (V), (n,), holds no level after its first long enough to show creep."""
    edges = np.flatnonzero(np.diff(drive, prepend=np.nan, append=np.nan) != 0.0)
    longest = int(np.diff(edges)[1:].max(initial=0))
    return longest < FEWEST or longest * sample_period < SHORTEST


def _holds(drive: Array, sample_period: float) -> Iterator[tuple[int, int]]:
    """First sample of each hold, and the sample after its last."""
    moving = np.flatnonzero(np.diff(drive)) + 1
    edges = np.concatenate([[0], moving, [len(drive)]])
    long = np.diff(edges) * sample_period > 2.0 * SETTLING
    yield from zip(edges[:-1][long].tolist(), edges[1:][long].tolist(), strict=True)


def _refuse_short(samples: int, sample_period: float) -> None:
    if samples < FEWEST or samples * sample_period < SHORTEST:
        raise InputError(
            f"creep record: the first step is held for {samples * sample_period:g} s, {samples}"
            f" samples; hold it for {SHORTEST:g} s and {FEWEST} samples at least, and for half an"
            " hour to see slow creep"
        )


def _step(move: Array, reached: int) -> CreepStep:
    height = float(move[-1] - move[0])
    if height == 0.0:
        raise InputError(
            f"creep record: the drive moves and is back at {move[0]:g} V by sample {reached};"
            " hold it at another level after each move"
        )
    return CreepStep(height, (move[1:-1] - move[0]) / height, reached)
