"""The drives that make a scanner show its creep, its frequency response and its hysteresis.

Each plan knows the voltage at any sample, so a record of any length is generated block by block.
Both axes are driven alike and at once: they are identified as decoupled.
"""

from collections.abc import Callable, Sequence
from typing import Protocol

import numpy as np
from attrs import field, frozen

from afm_scan_ros.core.types import Array, Trace

FRESH_LOOPS = np.array(
    [0.8, -0.6, 0.5, -0.85, 0.2, -0.3, 0.7, -0.1, 0.35, -0.45, 0.25, -0.15, 0.1, -0.05, 0.0]
)
"""Turning points, as shares of the limit, of loops that are no first-order reversal curves."""


class Plan(Protocol):
    """A drive from rest at 0 V back to rest at 0 V, known at every sample."""

    @property
    def name(self) -> str:
        """Name of the record."""
        ...

    @property
    def sample_period(self) -> float:
        """Seconds between samples."""
        ...

    @property
    def total_samples(self) -> int:
        """Samples in the record."""
        ...

    def voltage(self, samples: Array) -> Array:
        """Drive in V at the sample indices given, shape (n,)."""
        ...


def excitation_block(plan: Plan, first: int, count: int) -> Trace:
    """Drive voltage of both axes for up to ``count`` samples from ``first``; short at the end."""
    last = min(first + count, plan.total_samples)
    volts = plan.voltage(np.arange(first, last, dtype=np.float64))
    return Trace(first, plan.sample_period, volts, volts.copy())


@frozen(eq=False)
class Waypoints:
    """Smooth motion from level to level, each taking its time, with a pause of zero distance.

    ``samples[i]`` is when ``levels[i]`` is reached. The speed of a move rises and falls as a
    half cosine over ``blend`` samples (half the move where that is shorter) and is constant
    between, so the resonance is not struck at the corners.
    """

    name: str
    sample_period: float
    levels: Array
    samples: Array
    blend: float

    @property
    def total_samples(self) -> int:
        """Samples in the record."""
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


@frozen(eq=False)
class Multisine:
    """Random-phase multisines one after another, each repeated, fading in and out over a period."""

    name: str
    sample_period: float
    waves: Array
    """One period each, V, shape (realisations, period)."""
    repeats: int
    """Periods of each wave, the fades included."""
    _fade: Array = field(init=False)

    @_fade.default
    def _fade_in(self) -> Array:
        return np.asarray(0.5 - 0.5 * np.cos(np.pi * np.arange(self.period) / self.period))

    @property
    def total_samples(self) -> int:
        """Samples in the record."""
        return len(self.waves) * self.repeats * self.period

    @property
    def period(self) -> int:
        """Samples in one period."""
        return len(self.waves[0])

    def voltage(self, samples: Array) -> Array:
        """Drive in V at the sample indices given, shape (n,)."""
        turn, within = np.divmod(samples.astype(np.int64), self.period)
        wave, repeat = np.divmod(turn, self.repeats)
        fade = self._fade[within]
        envelope = np.where(repeat == 0, fade, np.where(repeat == self.repeats - 1, 1 - fade, 1.0))
        return np.asarray(self.waves[wave, within] * envelope)


def creep_plan(holds: Sequence[float] = (3000.0, 600.0)) -> Waypoints:
    """Steps of 0.5 V, each held for as many s as ``holds`` says, and a slow return to rest.

    The first hold, 50 min, lasts longer than the slowest creep looked for (some 1700 s); the second
    tests the fit. The hysteresis scales a step and, as its input then rests, leaves its shape
    alone. It would bend a slow move, so a step takes but one sample, 10 ms.
    """
    rate, height, rest = 100.0, 0.5, 5.0
    lengths = [rate * rest, *(n for hold in holds for n in (1.0, rate * hold)), rate * rest]
    levels = np.append(np.repeat(height * np.arange(len(holds) + 1), 2), 0.0)
    samples = np.rint(np.cumsum([0.0, *lengths]))
    return Waypoints("creep", 1.0 / rate, levels, samples, blend=5.0)


def frequency_plan(seed: int = 1) -> Multisine:
    """Low-amplitude multisines, 4 Hz to 2 kHz, four draws of the phases, five whole periods each.

    Lines lie every 2 Hz up to 700 Hz, which resolves the resonance, and every 10 Hz above. From
    200 Hz the amplitude falls as 1/f: the drive then turns round seldom, which keeps the
    hysteresis' share in the response small and modelled, and spares the amplifier. The first draw
    comes again at a fifth, two fifteenths and a fifteenth of the amplitude, to be extrapolated
    to none.
    """
    rate, period, peak = 50_000.0, 25_000, 1.5
    rng = np.random.default_rng(seed)
    dense, sparse = np.arange(2, 351), np.arange(355, 1001, 5)
    lines = np.concatenate([dense, sparse])
    amplitude = np.minimum(1.0, 100.0 / lines) * np.where(lines > dense[-1], 2.0, 1.0)
    spectrum = np.zeros((4, period // 2 + 1), dtype=np.complex128)
    spectrum[:, lines] = amplitude * np.exp(2j * np.pi * rng.random((4, len(lines))))
    waves = np.fft.irfft(spectrum, period)
    waves *= peak / np.abs(waves).max(axis=1, keepdims=True)
    weak = np.outer([0.3, 0.2, 0.1], waves[0] / peak)
    return Multisine("frequency", 1.0 / rate, np.concatenate([waves, weak]), repeats=7)


def hysteresis_plan(limit: float = 4.0, levels: int = 51) -> Waypoints:
    """First-order reversal curves of both families between ``-limit`` and ``limit`` V.

    From positive saturation the drive falls to each of the levels in turn, the lowest first, and
    returns; then from negative saturation it rises to each, the highest first, and returns. The
    ramps are of 10 V/s: 20 kHz sampling gives 2000 samples a volt. Loops within loops then lead
    back to zero: they fit nothing, the fit is tested on them.
    """
    rate, speed, blend = 20_000.0, 10.0, 0.02
    turns = np.linspace(-limit, limit, levels)[:-1]
    rising = np.column_stack([turns, np.full_like(turns, limit)]).ravel()
    curves = np.concatenate([rising, [-limit], -rising])
    path = np.concatenate([[0.0, 0.0, limit], curves, limit * FRESH_LOOPS, [0.0]])
    seconds = np.abs(np.diff(path)) / speed + blend
    seconds[[0, -1]] = 0.1
    samples = np.concatenate([[0.0], np.cumsum(np.rint(seconds * rate))])
    return Waypoints("hysteresis", 1.0 / rate, path, samples, blend * rate)


def validation_plan(limit: float = 3.6, seed: int = 2) -> Waypoints:
    """Moves between random levels, each faster than the last, 10 to 3000 V/s: it fits nothing.

    So it holds, as scans do, loops within loops at large and small amplitude and from slow to as
    fast as the scanner follows; its corners, rounded over 1 ms, strike the resonance.
    """
    rate, moves, blend = 50_000.0, 240, 1e-3
    levels = limit * np.random.default_rng(seed).uniform(-1.0, 1.0, moves)
    levels = np.concatenate([[0.0, 0.0], levels, [0.0, 0.0]])
    speeds = np.geomspace(10.0, 3000.0, moves + 1)
    seconds = np.concatenate([[0.5], np.abs(np.diff(levels[1:-1])) / speeds + blend, [0.5]])
    samples = np.concatenate([[0.0], np.cumsum(np.rint(seconds * rate))])
    return Waypoints("validation", 1.0 / rate, levels, samples, blend * rate)


PLANS: dict[str, Callable[[], Plan]] = {
    "creep": creep_plan,
    "frequency": frequency_plan,
    "hysteresis": hysteresis_plan,
    "validation": validation_plan,
}
"""The four records, by name."""
