"""Whether a displacement is the answer to its drive: of this axis, in step with it, from rest."""

from collections.abc import Iterator, Sequence
from itertools import permutations

import numpy as np

from afm_scan_ros.core.types import Array, Trace

EARLY, LATE = 1e-3, 1e-2
"""Seconds by which the displacement may seem to lead and lag: vibration and hysteresis delay it."""
CHANCE = 6.0
"""Correlation from which signals are related, in standard deviations of that of unrelated noise."""
ORIGIN = 0.05
"""Share of the whole motion by which the first rest may be off zero."""
AGAINST = -0.5
"""Correlation of drive and displacement that no delay or resonance explains."""
ALIKE = 0.999
"""Correlation of both drives beyond which nothing tells the one's answer from the other's."""


def motion_problems(drive: Trace, displacement: Trace, axes: Sequence[str]) -> Iterator[str]:
    """Yield what a displacement (m) shows that a scanner so driven (V) would not."""
    for axis, other in permutations(axes, 2):
        yield from _of_another(axis, other, drive, displacement)
    for axis in axes:
        given, moved = drive.axis(axis), displacement.axis(axis)
        yield from _sign(axis, given, moved)
        yield from _follows(axis, given, moved, drive.sample_period)
        yield from _origin(axis, given, moved)


def _of_another(axis: str, other: str, drive: Trace, displacement: Trace) -> Iterator[str]:
    moves = np.diff(displacement.axis(axis))
    own, foreign = (np.diff(drive.axis(name)) for name in (axis, other))
    if _belongs(foreign, own, moves):
        yield (
            f"displacement {axis} follows drive {other}: it is a record of axis {other}; connect"
            " the axes as they are named and record again"
        )


def _belongs(foreign: Array, own: Array, moves: Array) -> bool:
    """Whether moves follow a foreign drive's more than their own, where the two differ at all."""
    drives = [np.roll(signal, _lag(signal, moves)[0]) for signal in (foreign, own)]
    both = np.column_stack([signal / np.linalg.norm(signal) for signal in drives])
    normal = both.T @ both
    if abs(normal[0, 1]) > ALIKE:
        return False
    shares = np.linalg.solve(normal, both.T @ moves) / np.linalg.norm(moves)
    chance = CHANCE / np.sqrt(len(moves) * (1.0 - normal[0, 1] ** 2))
    return bool(shares[0] > max(2.0 * abs(shares[1]), chance))


def _follows(axis: str, drive: Array, displacement: Array, period: float) -> Iterator[str]:
    lag, correlation = _lag(np.diff(drive), np.diff(displacement))
    if correlation < CHANCE / np.sqrt(len(drive)):
        yield (
            f"displacement {axis} does not follow drive {axis}; record both of one scanner, at"
            " the same time"
        )
    if not -(EARLY + 2.0 * period) < lag * period < LATE + 2.0 * period:
        yield (
            f"displacement {axis} {'lags' if lag > 0 else 'leads'} its drive by"
            f" {abs(lag) * period:.3g} s: the two are not synchronised; start both on one clock"
        )


def _sign(axis: str, drive: Array, displacement: Array) -> Iterator[str]:
    """Find a sensor or an amplifier of the other sign."""
    if np.corrcoef(drive, displacement)[0, 1] < AGAINST:
        yield (
            f"displacement {axis} falls where its drive rises: the sensor or the amplifier has the"
            " other sign; record it with the sign turned"
        )


def _origin(axis: str, drive: Array, displacement: Array) -> Iterator[str]:
    """Find a sensor whose zero is elsewhere."""
    rest = displacement[: int(np.argmax(drive != drive[0]))].mean()
    if abs(rest) > ORIGIN * np.ptp(displacement):
        yield (
            f"displacement {axis} begins at {rest:.3g} m; take the sensor's zero where the record"
            " begins, at the scanner's depolarised rest"
        )


def _lag(moves: Array, follow: Array) -> tuple[int, float]:
    """Samples by which ``follow`` is best delayed against ``moves``, and their correlation then."""
    size = 1 << (2 * len(moves) - 1).bit_length()
    spectrum = np.fft.rfft(follow, size) * np.fft.rfft(moves, size).conj()
    correlation = np.fft.irfft(spectrum, size)
    best = int(np.argmax(correlation))
    scale = np.sqrt((moves @ moves) * (follow @ follow))
    return best - size * (best > size // 2), float(correlation[best] / scale)
