"""The drives that make a scanner show its creep, its frequency response and its hysteresis.

Both axes are driven at once, for they are identified as decoupled, and unlike each other, so that
a record shows which of them it is of.
"""

from collections.abc import Callable, Sequence
from typing import Generic, TypeVar

import numpy as np
from attrs import frozen

from afm_scan_ros.core.identification.drives.multisine import Multisine, random_phase_waves
from afm_scan_ros.core.identification.drives.waypoints import Waveform, Waypoints
from afm_scan_ros.core.types import Array, Trace

FRESH_LOOPS = np.array(
    [0.8, -0.6, 0.5, -0.85, 0.2, -0.3, 0.7, -0.1, 0.35, -0.45, 0.25, -0.15, 0.1, -0.05, 0.0]
)
"""Turning points, as shares of the limit, of loops that are no first-order reversal curves."""

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


def excitation_block(plan: Plan[Waveform], first: int, count: int) -> Trace:
    """Drive voltage of both axes for up to ``count`` samples from ``first``; short at the end."""
    last = min(first + count, plan.total_samples)
    samples = np.arange(first, last, dtype=np.float64)
    x, y = (
        axis.voltage(np.minimum(samples, axis.total_samples - 1.0)) for axis in (plan.x, plan.y)
    )
    return Trace(first, plan.sample_period, x, y)


def creep_plan(holds: Sequence[float] = (3000.0, 600.0)) -> Plan[Waypoints]:
    """Steps of 0.5 V, each held for as many s as ``holds`` says, and a slow return to rest.

    x steps up and up again, y down and back, at the same moments: what either does to the other
    then creeps alike. The first hold, 50 min, lasts longer than the slowest creep looked for (some
    1700 s); the second tests the fit. The hysteresis scales a step and, as its input then rests,
    leaves its shape alone. It would bend a slow move, so a step takes but one sample, 10 ms.
    """
    rate, height, rest = 100.0, 0.5, 5.0
    lengths = [rate * rest, *(n for hold in holds for n in (1.0, rate * hold)), rate * rest]
    samples = np.rint(np.cumsum([0.0, *lengths]))
    stair = np.arange(len(holds) + 1)
    x, y = (
        Waypoints(1.0 / rate, np.append(np.repeat(height * levels, 2), 0.0), samples, blend=5.0)
        for levels in (stair, -(stair % 2))
    )
    return Plan("creep", x, y)


def frequency_plan(seed: int = 1) -> Plan[Multisine]:
    """Low-amplitude multisines, 4 Hz to 2 kHz, four draws of the phases, five whole periods each.

    Lines lie every 2 Hz up to 700 Hz, which resolves the resonance, and every 10 Hz above. From
    200 Hz the amplitude falls as 1/f: the drive then turns round seldom, which keeps the
    hysteresis' share in the response small and modelled, and spares the amplifier. The first draw
    comes again at a fifth, two fifteenths and a fifteenth of the amplitude, to be extrapolated
    to none. The axes' phases are drawn apart.
    """
    rate, period, peak = 50_000.0, 25_000, 1.5
    rng = np.random.default_rng(seed)
    dense, sparse = np.arange(2, 351), np.arange(355, 1001, 5)
    lines = np.concatenate([dense, sparse])
    amplitudes = np.minimum(1.0, 100.0 / lines) * np.where(lines > dense[-1], 2.0, 1.0)

    def multisines() -> Multisine:
        waves = random_phase_waves(lines, amplitudes, period, rng.random((4, len(lines))))
        weak = np.outer([0.3, 0.2, 0.1], waves[0])
        return Multisine(1.0 / rate, np.concatenate([peak * waves, weak]), repeats=7)

    return Plan("frequency", multisines(), multisines())


def hysteresis_plan(limit: float = 4.0, levels: int = 51) -> Plan[Waypoints]:
    """First-order reversal curves of both families between ``-limit`` and ``limit`` V.

    From positive saturation the drive of x falls to each of the levels in turn, the lowest first,
    and returns; then from negative saturation it rises to each, the highest first, and returns. y
    takes the levels of each family the other way round. The ramps are of 10 V/s: 20 kHz sampling
    gives 2000 samples a volt. Loops within loops then lead back to zero, mirrored in y: they fit
    nothing, the fit is tested on them.
    """
    turns = np.linspace(-limit, limit, levels)[:-1]
    x = _reversal_curves(turns, limit, limit * FRESH_LOOPS)
    y = _reversal_curves(turns[::-1], limit, -limit * FRESH_LOOPS)
    return Plan("hysteresis", x, y)


def _reversal_curves(turns: Array, limit: float, fresh: Array) -> Waypoints:
    """Curves from positive saturation that turn at ``turns``, the same mirrored, then ``fresh``."""
    rate, speed, blend = 20_000.0, 10.0, 0.02
    falling = np.column_stack([turns, np.full_like(turns, limit)]).ravel()
    path = np.concatenate([[0.0, 0.0, limit], falling, [-limit], -falling, fresh, [0.0]])
    seconds = np.abs(np.diff(path)) / speed + blend
    seconds[[0, -1]] = 0.1
    samples = np.concatenate([[0.0], np.cumsum(np.rint(seconds * rate))])
    return Waypoints(1.0 / rate, path, samples, blend * rate)


def validation_plan(limit: float = 3.6, seeds: tuple[int, int] = (2, 3)) -> Plan[Waypoints]:
    """Moves between random levels, each faster than the last, 10 to 3000 V/s: it fits nothing.

    So it holds, as scans do, loops within loops at large and small amplitude and from slow to as
    fast as the scanner follows; its corners, rounded over 1 ms, strike the resonance.
    """
    x, y = (_random_moves(limit, seed) for seed in seeds)
    return Plan("validation", x, y)


def _random_moves(limit: float, seed: int) -> Waypoints:
    rate, moves, blend = 50_000.0, 240, 1e-3
    levels = limit * np.random.default_rng(seed).uniform(-1.0, 1.0, moves)
    levels = np.concatenate([[0.0, 0.0], levels, [0.0, 0.0]])
    speeds = np.geomspace(10.0, 3000.0, moves + 1)
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
