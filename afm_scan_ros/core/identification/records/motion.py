"""Whether a displacement is the answer to its drive: of this axis, in step with it, from rest."""

from collections.abc import Iterator, Mapping, Sequence
from itertools import permutations, product

import numpy as np
from attrs import frozen
from scipy.fft import irfft, next_fast_len, rfft

from afm_scan_ros.core.types import Array, Trace

EARLY, LATE = 1e-3, 2.5e-2
"""Seconds by which the displacement may seem to lead and lag: vibration and loops delay it."""
CHANCE = 6.0
"""Correlation from which signals are related, in standard deviations of that of unrelated noise."""
ORIGIN = 0.05
"""Share of the whole motion by which the first rest may be off zero."""
SLOWEST, AGAINST = 0.1, -0.5
"""Slowest share of the drive's power, and its correlation with the displacement that has none."""
ALIKE = 0.999
"""Correlation of both drives beyond which nothing tells the one's answer from the other's."""


@frozen
class Lag:
    """Samples by which a displacement is best delayed against a drive, and their correlation."""

    samples: int
    correlation: float


def motion_problems(drive: Trace, displacement: Trace, axes: Sequence[str]) -> Iterator[str]:
    """Yield what a displacement (m) shows that a scanner so driven (V) would not."""
    given, moved = ({a: np.diff(trace.axis(a)) for a in axes} for trace in (drive, displacement))
    lags = _lags(given, moved)
    for axis, other in permutations(axes, 2):
        foreign, own = (np.roll(given[a], lags[a, axis].samples) for a in (other, axis))
        if _belongs(foreign, own, moved[axis]):
            yield (
                f"displacement {axis} follows drive {other}: it is a record of axis {other};"
                " connect the axes as they are named and record again"
            )
    for axis in axes:
        yield from _follows(axis, lags[axis, axis], len(drive.x))
        yield from _sign(axis, drive.axis(axis), displacement.axis(axis))
        yield from _in_step(axis, lags[axis, axis].samples, drive.sample_period)
        yield from _origin(axis, drive.axis(axis), displacement.axis(axis))


def _belongs(foreign: Array, own: Array, moves: Array) -> bool:
    """Whether moves follow a foreign drive's more than their own, where the two differ at all."""
    both = np.column_stack([signal / np.linalg.norm(signal) for signal in (foreign, own)])
    normal = both.T @ both
    if abs(normal[0, 1]) > ALIKE:
        return False
    shares = np.linalg.solve(normal, both.T @ moves) / np.linalg.norm(moves)
    chance = CHANCE / np.sqrt(len(moves) * (1.0 - normal[0, 1] ** 2))
    return bool(shares[0] > max(2.0 * abs(shares[1]), chance))


def _follows(axis: str, lag: Lag, samples: int) -> Iterator[str]:
    if lag.correlation < CHANCE / np.sqrt(samples):
        yield (
            f"displacement {axis} does not follow drive {axis}; record both of one scanner, at"
            " the same time"
        )


def _in_step(axis: str, samples: int, period: float) -> Iterator[str]:
    late = samples * period
    if not -(EARLY + 2.0 * period) < late < LATE + 2.0 * period:
        yield (
            f"displacement {axis} {'lags' if late > 0.0 else 'leads'} its drive by"
            f" {abs(late):.3g} s: the two are not synchronised; start both on one clock"
        )


def _sign(axis: str, drive: Array, displacement: Array) -> Iterator[str]:
    """Find a sensor or an amplifier of the other sign, where the drive is too slow to resonate."""
    given, moved = (rfft(signal - signal.mean()) for signal in (drive, displacement))
    power = np.cumsum(np.abs(given) ** 2)
    slow = power <= max(SLOWEST * power[-1], power[1])
    likeness = np.vdot(given[slow], moved[slow]).real
    if likeness < AGAINST * np.linalg.norm(given[slow]) * np.linalg.norm(moved[slow]):
        yield (
            f"displacement {axis} falls where its drive rises: the sensor or the amplifier has the"
            " other sign; record it with the sign turned"
        )


def _origin(axis: str, drive: Array, displacement: Array) -> Iterator[str]:
    """Find a sensor whose zero is elsewhere."""
    rest = rest_of(drive, displacement)
    if abs(rest) > ORIGIN * np.ptp(displacement):
        yield (
            f"displacement {axis} begins at {rest:.3g} m; take the sensor's zero where the record"
            " begins, at the scanner's depolarised rest"
        )


def rest_of(drive: Array, displacement: Array) -> float:
    """Return the mean displacement (m) before the drive first moves, both (n,)."""
    return float(displacement[: int(np.argmax(drive != drive[0]))].mean())


def _lags(given: Mapping[str, Array], moved: Mapping[str, Array]) -> dict[tuple[str, str], Lag]:
    """Lag of each axis' moves against each axis' drive, by the names of drive and displacement."""
    length = len(next(iter(given.values())))
    size = next_fast_len(2 * length - 1, real=True)
    drives, moves = (
        {axis: rfft(values / np.linalg.norm(values), size) for axis, values in signals.items()}
        for signals in (given, moved)
    )
    found = {}
    for drive, displacement in product(drives, moves):
        correlation = irfft(moves[displacement] * drives[drive].conj(), size)
        best = int(np.argmax(correlation))
        samples = best - size * (best > size // 2)
        found[drive, displacement] = Lag(samples, float(correlation[best]))
    return found
