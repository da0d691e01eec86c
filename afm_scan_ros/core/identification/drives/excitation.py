"""The drives that make a scanner show its creep, its frequency response and its hysteresis.

Both axes are driven at once, for they are identified as decoupled, and unlike each other, so that
a record shows which of them it is of.
"""

from collections.abc import Callable, Sequence

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from afm_scan_ros.core.identification.drives.waveforms import (
    multisine,
    random_phase_waves,
    waypoints,
)
from afm_scan_ros.core.types import Array, Trace

DEFAULT_RESONANCE = 454.0
"""Hz, of the scanner that the default drives are for."""
DEFAULT_LIMIT = 3.6
"""V that the default validation drive reaches."""


@frozen(eq=False)
class Plan:
    """Drives of both axes, V at every sample; the one that is done first rests."""

    name: str
    sample_period: float
    x: Array
    y: Array

    @property
    def total_samples(self) -> int:
        """Samples in the record."""
        return max(len(self.x), len(self.y))

    @property
    def duration(self) -> float:
        """Length of the record, s."""
        return self.total_samples * self.sample_period


def excitation_block(plan: Plan, first: int, count: int) -> Trace:
    """Drive voltage of both axes for up to ``count`` samples from ``first``; short at the end."""
    samples = np.arange(first, min(first + count, plan.total_samples))
    x, y = (axis[np.minimum(samples, len(axis) - 1)] for axis in (plan.x, plan.y))
    return Trace(first, plan.sample_period, x, y)


def scaled(plan: Plan, size: float, time: float = 1.0) -> Plan:
    """Return a plan whose voltages are multiplied by ``size``, and its times by ``time``."""
    return Plan(plan.name, time * plan.sample_period, size * plan.x, size * plan.y)


def creep_plan(
    holds: Sequence[float] = (3000.0, 600.0),
    height: float = 0.5,
    rate: float = 100.0,
    down: int = -1,
) -> Plan:
    """Steps of ``height`` V, each held for the times ``holds`` (s), and a slow return to rest.

    x steps up and up again, y down and back, at the same moments: what either does to the other
    then creeps alike. The first hold, 50 min, lasts longer than the slowest creep looked for (some
    1700 s). It is sampled at ``rate`` Hz. The hysteresis scales a step
    and, as its input then rests, leaves its shape alone. It would bend a slow move, so a step takes
    one sample. With a ``down`` of 1 y steps up and back.
    """
    rest = 5.0
    lengths = [rate * rest, *(n for hold in holds for n in (1.0, rate * hold)), rate * rest]
    samples = np.rint(np.cumsum([0.0, *lengths]))
    stair = np.arange(len(holds) + 1)
    x, y = (
        waypoints(np.append(np.repeat(height * levels, 2), 0.0), samples, 0.05 * rate)
        for levels in (stair, down * (stair % 2))
    )
    return Plan("creep", 1.0 / rate, x, y)


def frequency_plan() -> Plan:
    """A random-phase multisine of low amplitude, seven periods; each axis has phases of its own.

    Lines every 2 Hz up to 700 Hz resolve the resonance, and others lie every 10 Hz to 2 kHz. From
    200 Hz the amplitude falls as 1/f: the drive then turns round seldom, which keeps the
    hysteresis' share in the response small, and spares the amplifier.
    """
    dense, sparse = np.arange(2, 351), np.arange(355, 1001, 5)
    lines = np.concatenate([dense, sparse])
    amplitudes = np.minimum(1.0, 100.0 / lines) * np.where(lines > dense[-1], 2.0, 1.0)
    return waves_plan("frequency", 20_000.0, 10_000, lines, amplitudes, peak=0.5)


def waves_plan(
    name: str,
    rate: float,
    period: int,
    lines: NDArray[np.int64],
    amplitudes: Array,
    peak: float,
    repeats: int = 7,
) -> Plan:
    """Sines summed over a ``period`` (samples at ``rate`` Hz) and repeated; phases differ by axis.

    ``lines`` are in cycles a period, (m,), ``amplitudes`` their relative sizes, (m,), ``peak`` is
    the largest wave's peak, V.
    """
    rng = np.random.default_rng(1)
    x, y = (
        random_phase_waves(lines, amplitudes, period, rng.random((1, len(lines)))) for _ in range(2)
    )
    return Plan(name, 1.0 / rate, multisine(peak * x, repeats), multisine(peak * y, repeats))


MOVES = 240
"""Moves between levels: 97 in each decade of speed."""
SPEEDS = 10.0, 3000.0
"""Of the slowest and the fastest move of the default drives, V/s."""
RINGING = 3.0
"""Periods of the resonance in which a move across the range excites it little; shorter ones are
made smaller by the root of the ratio, so that what rings goes little farther than slow moves."""


def hysteresis_plan(
    limit: float = 4.0,
    rate: float = 20e3,
    resonance: float = DEFAULT_RESONANCE,
    moves: int = MOVES,
) -> Plan:
    """Moves between random levels within ``limit`` V, each faster than the last.

    The first two go to both ends, so that the memory is known from there on. The slowest move
    across the range lasts 327 periods of the ``resonance`` (Hz), the fastest 1.1. So it holds, as
    scans do, loops within loops at large and small amplitude and from slow to as fast as the
    scanner follows; its corners, rounded over 0.45 periods, strike the resonance. It is sampled at
    ``rate`` Hz.
    """
    return _levels_plan("hysteresis", limit, (4, 5), rate, resonance, moves)


def validation_plan(
    limit: float = DEFAULT_LIMIT,
    seeds: tuple[int, int] = (2, 3),
    rate: float = 20e3,
    resonance: float = DEFAULT_RESONANCE,
    moves: int = MOVES,
) -> Plan:
    """Moves as those of ``hysteresis_plan`` between other levels: they are held out of the fit."""
    return _levels_plan("validation", limit, seeds, rate, resonance, moves)


def _levels_plan(
    name: str, limit: float, seeds: tuple[int, int], rate: float, resonance: float, moves: int
) -> Plan:
    tempo, firsts = resonance / DEFAULT_RESONANCE, (limit, -limit)
    x, y = (
        _random_moves(first, seed, rate, tempo, moves)
        for first, seed in zip(firsts, seeds, strict=True)
    )
    return Plan(name, 1.0 / rate, x, y)


def _random_moves(first: float, seed: int, rate: float, tempo: float, moves: int) -> Array:
    """Moves to the level ``first`` (V), to the opposite end, and between random ones."""
    blend, speeds = 1e-3 / tempo, tempo / DEFAULT_LIMIT * np.geomspace(*SPEEDS, moves + 1)
    levels = np.random.default_rng(seed).uniform(-1.0, 1.0, moves - 2)
    levels = np.concatenate([[0.0, 1.0, -1.0], levels, [0.0]])
    seconds = np.abs(np.diff(levels)) / speeds + blend
    periods = 2.0 / speeds[1:] * tempo * DEFAULT_RESONANCE
    levels[1:-1] *= np.minimum(1.0, np.sqrt(periods[:moves] / RINGING))
    path = first * np.concatenate([[0.0], levels, [0.0]])
    samples = np.concatenate([[0.0], np.cumsum(np.rint(np.r_[0.5, seconds, 0.5] * rate))])
    return waypoints(path, samples, blend * rate)


PLANS: dict[str, Callable[[], Plan]] = {
    "creep": creep_plan,
    "frequency": frequency_plan,
    "hysteresis": hysteresis_plan,
    "validation": validation_plan,
}
"""The four records, by name."""
