"""One axis of a record as the fit takes it: blocks of samples, with their noise, in stretches."""

from collections.abc import Iterable
from functools import cached_property

import numpy as np
from attrs import evolve, frozen

from afm_scan_ros.core.effects.sensor import led
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.fit.noise import noise_of, without_noise
from afm_scan_ros.core.fit.settings import FitSettings
from afm_scan_ros.core.fit.stretches import Edges, averaged, smooth_edges
from afm_scan_ros.core.intersample import HELD, INTERPOLATION, read_between, upsampling
from afm_scan_ros.core.record import Record
from afm_scan_ros.core.types import Array


@frozen(eq=False)
class Signals:
    """Drive u (V) and displacement y (m), both (n,), that count from sample ``first`` on.

    ``upsampling`` samples stand for each that was measured. ``rested`` is whether the scanner had
    long rested at 0 V, depolarised; otherwise ``unknown`` says which of the unknown starts of a fit
    the record has, where it has one. The drive is the ``recorded`` one of ``late`` samples earlier,
    where it is late. It is ``held`` between samples where the record says so, and a sample
    ``ahead`` of the record's where the displacement was read after each update of the drive.
    ``noise`` (m) is the standard deviation of a sample, ``tones`` (Hz) are sines in the
    displacement. Stretches of blocks, of one row of derivatives each, have ``edges`` in samples.
    """

    name: str
    drive: Array
    displacement: Array
    period: float
    block: int
    first: int
    rested: bool
    noise: float
    edges: Edges
    tones: tuple[float, ...] = ()
    unknown: int | None = None
    late: int = 0
    recorded: Array | None = None
    upsampling: int = 1
    held: bool = True
    ahead: bool = False

    @property
    def given(self) -> Array:
        """The drive before it was made late, V."""
        return self.drive if self.recorded is None else self.recorded

    @property
    def sampled(self) -> float:
        """Time between measured samples, s."""
        return self.upsampling * self.period

    @property
    def blocks(self) -> int:
        """Number of blocks, those before ``first`` included."""
        return len(self.drive) // self.block

    @property
    def used(self) -> slice:
        """The blocks that count."""
        return slice(-(-self.first // self.block), self.blocks)

    @cached_property
    def stretches(self) -> slice:
        """The stretches that count."""
        start = int(np.searchsorted(self.edges, self.used.start * self.block))
        return slice(start, len(self.edges) - 1)

    @cached_property
    def weights(self) -> Array:
        """Roots of the number of blocks in each stretch that counts."""
        return np.asarray(np.sqrt(np.diff(self.edges[self.stretches.start :]) / self.block))

    def gathered(self, signal: Array) -> Array:
        """Sums over stretches of a signal over the blocks that count, divided by ``weights``.

        Their products with derivatives times ``weights`` are those with the derivatives of blocks.
        """
        edges = self.edges[self.stretches.start :] // self.block - self.used.start
        return np.asarray((np.add.reduceat(signal, edges[:-1]).T / self.weights).T)

    @cached_property
    def mean(self) -> Array:
        """Displacement averaged over the blocks that count, m."""
        return averaged(self.displacement, self.block)[self.used]

    @cached_property
    def motion(self) -> float:
        """Standard deviation of the displacement, m."""
        return float(np.std(self.mean))

    @property
    def length(self) -> float:
        """Length of a block, s."""
        return self.block * self.period

    @property
    def seconds(self) -> Array:
        """Time of the blocks that count, since the record's start."""
        return np.asarray(self.length * (np.arange(self.blocks)[self.used] + 0.5))

    def regressors(self, time_constants: Array, creep: float) -> Array:
        """What a record holds beside the model, as regressors (m), shape (blocks, regressors).

        They are its offset; where it began in motion, creep that goes on from before (time
        constants in s); and its tones, whose amplitudes may change along the record. The weight of
        the offset is free, the others have a standard deviation of 1: creep is then of a share
        ``creep`` of the motion.
        """
        seconds = self.seconds[:, np.newaxis]
        columns: list[Array] = [np.ones_like(seconds)]
        if not self.rested:
            columns.append(creep * self.motion * np.exp(-seconds / time_constants))
        for tone in self.tones:
            turn, along = 2.0 * np.pi * tone * seconds, 2.0 * seconds / seconds[-1] - 1.0
            pair = self.motion * np.hstack([np.cos(turn), np.sin(turn)])
            columns += [pair, along * pair]
        return np.concatenate(columns, axis=1)

    def read_late(self, samples: int, half_range: float, settings: FitSettings) -> "Signals":
        """Return the record with a drive that is late by so many samples.

        Until then it is what it was at the first sample. ``half_range`` is the operator's (V).
        """
        first = self.first + samples - self.late if self.first else 0
        drive = _later(self.given, samples)
        late = evolve(self, drive=drive, first=first, late=samples, recorded=self.given)
        return late.stretched(half_range, settings)

    def read_after(self, half_range: float, settings: FitSettings) -> "Signals":
        """Return the record as one whose displacement was read after its drive's updates."""
        if self.ahead:
            return self
        return evolve(self, drive=led(self.drive), ahead=True).stretched(half_range, settings)

    def stretched(self, half_range: float, settings: FitSettings) -> "Signals":
        """Return the record in the longest stretches of blocks over which it is smooth."""
        both = averaged(self.drive, self.block), averaged(self.displacement, self.block)
        quiet, begins = self.noise / np.sqrt(self.block), -(-self.first // self.block)
        edges = smooth_edges(*both, quiet, half_range, begins, settings)
        return evolve(self, edges=self.block * edges)

    def without_drive_noise(self, half_range: float, settings: FitSettings) -> "Signals":
        """Return the record with its drive less the noise with which that was measured."""
        quiet = without_noise(self.given, half_range, settings)
        return evolve(self, drive=_later(quiet, self.late), recorded=quiet)

    def with_tones(self, tones: Iterable[float], most: int) -> "Signals":
        """Add tones (Hz), at most so many in all, but none within a bin of one that is there."""
        found, bin_width = list(self.tones), 1.0 / (self.length * len(self.mean))
        for tone in tones:
            apart = np.abs(np.subtract(found, tone)).min(initial=np.inf)
            if apart > bin_width and len(found) < most:
                found.append(tone)
        return evolve(self, tones=tuple(found))


@frozen(eq=False)
class Free:
    """What is free in one record, as linear regressors with their prior, and their products."""

    columns: Array
    products: Array
    variance: float

    @cached_property
    def matrix(self) -> Array:
        """H of the regressors, of which all but the offset have a prior of unit variance."""
        prior = np.diag([0.0, *np.ones(len(self.products) - 1)])
        return np.asarray(self.products / self.variance + prior)

    def weights(self, signal: Array) -> Array:
        """Weights of the regressors that explain a signal best."""
        right = self.columns.T @ signal / self.variance
        return np.asarray(np.linalg.solve(self.matrix, right))

    def without(self, signal: Array) -> Array:
        """Return a signal without what the regressors explain of it."""
        return np.asarray(signal - self.columns @ self.weights(signal))


def signals_of(
    record: Record,
    drive: Array,
    half_range: float,
    settings: FitSettings,
    *,
    remembers: bool = True,
) -> Signals:
    """Choose the blocks and stretches of a record of one axis, and from where on it counts.

    Its ``drive`` (V) holds the voltages that led to each displacement. What comes before its memory
    is known is left out where the scanner ``remembers``, unless that is most of the record.
    ``half_range`` is that of the operator (V).
    """
    every, (measured,) = upsampling(record.intersample), record.displacement.T
    if len(measured) < settings.fewest_blocks:
        raise InputError(
            f"{record.name}: holds only {len(measured)} samples: give a record of"
            f" {settings.fewest_blocks} at least"
        )
    displacement = read_between(measured, record.intersample)
    if every > 1:
        edge = INTERPOLATION.edge
        known = slice(0 if record.depolarised else every * edge, every * (len(measured) - edge))
        drive, displacement = drive[known], displacement[known]
    noise = float(np.sqrt(every)) * noise_of(measured, settings.finest)
    block = longest_block(drive, displacement, noise, settings, every)
    first = known_from(drive, settings, depolarised=record.depolarised or not remembers)
    first = first if first < settings.most_left_out * len(drive) else 0
    period, begun = record.sample_period / every, record.depolarised
    given = record.name, drive, displacement, period, block, first, begun, noise
    one, held = np.array([0, len(drive)], np.intp), record.intersample == HELD
    return Signals(*given, one, upsampling=every, held=held).stretched(half_range, settings)


def _later(drive: Array, samples: int) -> Array:
    """Return a drive (V), (n,), late by so many samples; at first it is what it began with."""
    return np.concatenate([np.full(samples, drive[0]), drive])[: len(drive)]


def steps_read_after(record: Record, settings: FitSettings) -> bool:
    """Whether a record of one axis follows steps of a held drive within their own sample.

    Such a displacement was read after the drive's update: just before it, nothing of a step shows
    yet. A step follows a drive that rests. A record is judged where steps are most of its drive.
    """
    if record.intersample != HELD:
        return False
    drive, displacement = record.signals(record.axes[0])
    change, moved = np.diff(drive), np.diff(displacement)
    rests = np.concatenate([[True], change[:-1] == 0.0])
    steps = np.flatnonzero((change != 0.0) & rests)
    if np.abs(change[steps]).sum() <= 0.5 * np.abs(change).sum():
        return False
    size = float(change[steps] @ change[steps])
    following = np.append(moved[1:], 0.0)
    seen, later = (float(change[steps] @ each[steps]) / size for each in (moved, following))
    noise = np.sqrt(2.0 / size) * noise_of(displacement, settings.finest)
    return bool(abs(seen) > max(settings.read_after * noise, 0.5 * abs(seen + later)))


def longest_block(
    drive: Array, displacement: Array, noise: float, settings: FitSettings, shortest: int = 1
) -> int:
    """Length of the longest blocks between whose means both signals are straight."""
    block = shortest
    while len(drive) // (2 * block) >= settings.fewest_blocks:
        longer = 2 * block
        bent = _bend(drive, longer) > settings.bend * np.std(drive)
        if bent or _bend(displacement, longer) ** 2 > (1.0 + settings.lost) * noise**2:
            break
        block = longer
    return block


def _bend(signal: Array, block: int) -> float:
    """Rms distance of samples from straight lines between means of blocks."""
    mean = averaged(signal, block)
    place = (np.arange(len(mean) * block) - 0.5 * (block - 1)) / block
    straight = np.interp(place, np.arange(len(mean)), mean)
    return float(np.sqrt(np.mean((signal[: len(straight)] - straight)[block:-block] ** 2)))


def known_from(drive: Array, settings: FitSettings, *, depolarised: bool) -> int:
    """Sample from which on a prediction of a record counts, as the memory is then known.

    From an unknown start all is written anew when the drive has been near both of its ends. Where
    it hardly moves after that, or the record ends, the whole record counts all the same, as of a
    scanner that came to the first sample from long motion.
    """
    if depolarised:
        return 0
    within = settings.near_end * np.ptp(drive)
    ends = drive >= drive.max() - within, drive <= drive.min() + within
    first = max(int(np.argmax(end)) for end in ends)
    enough = len(drive) - first >= settings.fewest_blocks and np.ptp(drive[first:]) > within
    return first if enough else 0
