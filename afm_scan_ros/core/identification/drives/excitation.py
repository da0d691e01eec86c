"""The drives that make a scanner show its creep, its frequency response and its hysteresis.

Both axes are driven at once, for they are identified as decoupled, and unlike each other, so that
a record shows which of them it is of.
"""

from collections.abc import Callable, Sequence
from typing import Generic, TypeVar

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from afm_scan_ros.core.identification.drives.waveforms import (
    Multisine,
    Scaled,
    Waveform,
    Waypoints,
    random_phase_waves,
)
from afm_scan_ros.core.types import Array, Trace

FRESH_LOOPS = np.array(
    [0.8, -0.6, 0.5, -0.85, 0.2, -0.3, 0.7, -0.1, 0.35, -0.45, 0.25, -0.15, 0.1, -0.05, 0.0]
)
"""Turning points, as shares of the limit, of loops that are no first-order reversal curves."""

DEFAULT_RESONANCE = 454.0
"""Hz, of the scanner that the default drives are for."""
DEFAULT_LIMIT = 3.6
"""V that the default validation drive reaches."""

Driven_co = TypeVar("Driven_co", bound=Waveform, covariant=True)


@frozen(eq=False)
class Plan(Generic[Driven_co]):
    """The drives of both axes, at one sample period; the one that is done first rests."""

    name: str
    x: Driven_co
    y: Driven_co

    @property
    def sample_period(self) -> float:
        """Seconds between samples."""
        return self.x.sample_period

    @property
    def total_samples(self) -> int:
        """Samples in the record."""
        return max(self.x.total_samples, self.y.total_samples)

    @property
    def duration(self) -> float:
        """Length of the record, s."""
        return self.total_samples * self.sample_period


def excitation_block(plan: Plan[Waveform], first: int, count: int) -> Trace:
    """Drive voltage of both axes for up to ``count`` samples from ``first``; short at the end."""
    last = min(first + count, plan.total_samples)
    samples = np.arange(first, last, dtype=np.float64)
    x, y = (
        axis.voltage(np.minimum(samples, axis.total_samples - 1.0)) for axis in (plan.x, plan.y)
    )
    return Trace(first, plan.sample_period, x, y)


def scaled(plan: Plan[Waveform], size: float, time: float = 1.0) -> Plan[Waveform]:
    """Return a plan whose voltages are multiplied by ``size``, and its times by ``time``."""
    return Plan(plan.name, Scaled(plan.x, size, time), Scaled(plan.y, size, time))


def creep_plan(
    holds: Sequence[float] = (3000.0, 600.0),
    height: float = 0.5,
    rate: float = 100.0,
    down: int = -1,
) -> Plan[Waypoints]:
    """Steps of ``height`` V, each held for the times ``holds`` (s), and a slow return to rest.

    x steps up and up again, y down and back, at the same moments: what either does to the other
    then creeps alike. The first hold, 50 min, lasts longer than the slowest creep looked for (some
    1700 s); the second tests the fit. It is sampled at ``rate`` Hz. The hysteresis scales a step
    and, as its input then rests, leaves its shape alone. It would bend a slow move, so a step takes
    one sample. With a ``down`` of 1 y steps up and back.
    """
    rest = 5.0
    lengths = [rate * rest, *(n for hold in holds for n in (1.0, rate * hold)), rate * rest]
    samples = np.rint(np.cumsum([0.0, *lengths]))
    stair = np.arange(len(holds) + 1)
    x, y = (
        Waypoints(1.0 / rate, np.append(np.repeat(height * levels, 2), 0.0), samples, 0.05 * rate)
        for levels in (stair, down * (stair % 2))
    )
    return Plan("creep", x, y)


@frozen(eq=False)
class FrequencyLines:
    """Sines of one period that a frequency record sums.

    ``period`` is in samples at ``rate`` Hz, ``lines`` in cycles a period, (m,), ``amplitudes``
    their relative sizes, (m,), ``peak`` the largest wave's peak, V.
    """

    rate: float
    period: int
    lines: NDArray[np.int64]
    amplitudes: Array
    peak: float


def default_lines() -> FrequencyLines:
    """Lines every 2 Hz up to 700 Hz, which resolves the resonance, and every 10 Hz to 2 kHz.

    From 200 Hz the amplitude falls as 1/f: the drive then turns round seldom, which keeps the
    hysteresis' share in the response small and modelled, and spares the amplifier.
    """
    dense, sparse = np.arange(2, 351), np.arange(355, 1001, 5)
    lines = np.concatenate([dense, sparse])
    amplitudes = np.minimum(1.0, 100.0 / lines) * np.where(lines > dense[-1], 2.0, 1.0)
    return FrequencyLines(50_000.0, 25_000, lines, amplitudes, peak=1.5)


def frequency_plan(lines: FrequencyLines | None = None) -> Plan[Multisine]:
    """Low-amplitude multisines, four draws of the phases, five whole periods each.

    The first draw comes again at a fifth, two fifteenths and a fifteenth of the amplitude, to be
    extrapolated to none. The axes' phases are drawn apart.
    """
    sines = default_lines() if lines is None else lines
    rng = np.random.default_rng(1)

    def multisines() -> Multisine:
        phases = rng.random((4, len(sines.lines)))
        waves = random_phase_waves(sines.lines, sines.amplitudes, sines.period, phases)
        weak = np.outer(sines.peak * np.array([3.0, 2.0, 1.0]) / 15.0, waves[0])
        sizes = np.concatenate([sines.peak * waves, weak])
        return Multisine(1.0 / sines.rate, sizes, repeats=7)

    return Plan("frequency", multisines(), multisines())


MIDDLE, GROWTH = 3.0, 0.1
"""Levels lie as sinh(MIDDLE x), x evenly: in the middle three times as dense as evenly. Fewer ones
lie less densely there, so that each distance is at most 1 + GROWTH times the next."""


def graded(limit: float, levels: int) -> Array:
    """Levels (levels,) between ``-limit`` and ``limit`` V, densest in the middle."""
    middle = min(MIDDLE, 0.5 * GROWTH * (levels - 1))
    return np.asarray(limit * np.sinh(middle * np.linspace(-1.0, 1.0, levels)) / np.sinh(middle))


def hysteresis_plan(limit: float = 4.0, levels: int = 61, rate: float = 20e3) -> Plan[Waypoints]:
    """First-order reversal curves of both families between ``-limit`` and ``limit`` V.

    From positive saturation the drive of x falls to each of the levels in turn, the lowest first,
    and returns; then from negative saturation it rises to each, the highest first, and returns. The
    levels are densest about the middle, where small scans turn. y takes those of each family the
    other way round. A ramp from saturation to saturation takes 0.8 s; it is sampled at ``rate`` Hz.
    Loops within loops then lead back to zero, mirrored in y: they are held out, to test the fit
    on them.
    """
    turns = graded(limit, levels)[:-1]
    x = _reversal_curves(turns, limit, limit * FRESH_LOOPS, rate)
    y = _reversal_curves(turns[::-1], limit, -limit * FRESH_LOOPS, rate)
    return Plan("hysteresis", x, y)


def _reversal_curves(turns: Array, limit: float, fresh: Array, rate: float) -> Waypoints:
    """Curves from positive saturation that turn at ``turns``, the same mirrored, then ``fresh``."""
    speed, blend = limit / 0.4, 0.02
    falling = np.column_stack([turns, np.full_like(turns, limit)]).ravel()
    path = np.concatenate([[0.0, 0.0, limit], falling, [-limit], -falling, fresh, [0.0]])
    seconds = np.abs(np.diff(path)) / speed + blend
    seconds[[0, -1]] = 0.1
    samples = np.concatenate([[0.0], np.cumsum(np.rint(seconds * rate))])
    return Waypoints(1.0 / rate, path, samples, blend * rate)


def validation_plan(
    limit: float = DEFAULT_LIMIT,
    seeds: tuple[int, int] = (2, 3),
    rate: float = 50e3,
    resonance: float = DEFAULT_RESONANCE,
) -> Plan[Waypoints]:
    """Moves between random levels, each faster than the last: it is held out of the fit.

    The slowest move across the range lasts 327 periods of the ``resonance`` (Hz), the fastest 1.1.

    So it holds, as scans do, loops within loops at large and small amplitude and from slow to as
    fast as the scanner follows; its corners, rounded over 0.45 periods, strike the resonance. It is
    sampled at ``rate`` Hz.
    """
    x, y = (_random_moves(limit, seed, rate, resonance / DEFAULT_RESONANCE) for seed in seeds)
    return Plan("validation", x, y)


def _random_moves(limit: float, seed: int, rate: float, tempo: float) -> Waypoints:
    moves, blend = 240, 1e-3 / tempo
    levels = limit * np.random.default_rng(seed).uniform(-1.0, 1.0, moves)
    levels = np.concatenate([[0.0, 0.0], levels, [0.0, 0.0]])
    speeds = tempo * limit / DEFAULT_LIMIT * np.geomspace(10.0, 3000.0, moves + 1)
    seconds = np.concatenate([[0.5], np.abs(np.diff(levels[1:-1])) / speeds + blend, [0.5]])
    samples = np.concatenate([[0.0], np.cumsum(np.rint(seconds * rate))])
    return Waypoints(1.0 / rate, levels, samples, blend * rate)


PLANS: dict[str, Callable[[], Plan[Waveform]]] = {
    "creep": creep_plan,
    "frequency": frequency_plan,
    "hysteresis": hysteresis_plan,
    "validation": validation_plan,
}
"""The four records, by name."""
