"""Whether a displacement is the answer to its drive: of this axis, in step, and not at a limit."""

from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise, permutations, product
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, next_fast_len, rfft
from scipy.signal import detrend
from scipy.stats import t as student

from afm_scan_ros.core.types import Array, Trace

EARLY, LATE = 1e-3, 2.5e-2
"""Seconds by which the displacement may seem to lead and lag. Half a period of a resonance at
20 Hz, slower than that of any scanner, and the filter of a sensor delay it no more."""
CHANCE = 6.0
"""Correlation from which signals are related, in standard deviations of that of unrelated noise."""
SLOWEST, AGAINST = 0.1, -0.5
"""Slowest share of the drive's power, and its correlation with the displacement that has none."""
EPSILON = np.finfo(float).eps
ALIKE = 0.999
"""Correlation of both drives beyond which the responses to them cannot be separated."""


def motion_problems(drive: Trace, displacement: Trace, axes: Sequence[str]) -> Iterator[str]:
    """Yield what a displacement (m) shows that a scanner so driven (V) would not."""
    changes = {axis: _changes(drive.axis(axis), displacement.axis(axis)) for axis in axes}
    given, moved = ({axis: changes[axis][k] for axis in axes} for k in (0, 1))
    lags = _lags(given, moved)
    for axis, other in permutations(axes, 2):
        foreign, own = (np.roll(given[a], lags[a, axis][0]) for a in (other, axis))
        if _belongs(foreign, own, moved[axis]):
            yield (
                f"displacement {axis} follows drive {other}: it is a record of axis {other};"
                " connect the axes as they are named and record again"
            )
    for axis in axes:
        late, correlation = lags[axis, axis]
        if correlation < CHANCE / np.sqrt(len(drive.x)):
            yield from _follows(axis, drive.axis(axis), displacement.axis(axis))
        yield from _sign(axis, drive.axis(axis), displacement.axis(axis))
        turns, _ = _lags({axis: np.sign(given[axis])}, {axis: moved[axis]})[axis, axis]
        least = min(late, turns, key=abs)
        if _surely(least, drive.sample_period, given[axis], moved[axis]):
            yield from _in_step(axis, least, drive.sample_period)


def _changes(drive: Array, displacement: Array) -> tuple[Array, Array]:
    """Return the steps of both signals, (n - 1,), or their values where a drive is like noise.

    A displacement shows what its drive did whichever is wider of band: the steps of noise are of
    frequencies at which a scanner hardly moves.
    """
    if np.var(np.diff(drive)) < np.var(drive):
        return np.diff(drive), np.diff(displacement)
    return drive[1:] - drive.mean(), displacement[1:] - displacement.mean()


def _belongs(foreign: Array, own: Array, moves: Array) -> bool:
    """Whether moves follow a foreign drive's more than their own, where the two differ at all."""
    both = np.column_stack([signal / np.linalg.norm(signal) for signal in (foreign, own)])
    normal = both.T @ both
    if abs(normal[0, 1]) > ALIKE:
        return False
    shares = np.linalg.solve(normal, both.T @ moves) / np.linalg.norm(moves)
    chance = CHANCE / np.sqrt(len(moves) * (1.0 - normal[0, 1] ** 2))
    return bool(shares[0] > max(2.0 * abs(shares[1]), chance))


def _follows(axis: str, drive: Array, displacement: Array) -> Iterator[str]:
    """Find signals of which not even the values are related, where the steps are not.

    Unrelated signals correlate by chance as much as Bartlett's formula states (Box, Jenkins, Time
    Series Analysis, 1976, 11.1); near 1 it is Fisher's transform that is normal.
    """
    size = next_fast_len(2 * len(drive), real=True)
    given, moved = (rfft(signal - signal.mean(), size) for signal in (drive, displacement))
    power, other = np.abs(given) ** 2, np.abs(moved) ** 2
    chance = np.sqrt(np.sum(power * other) / (np.sum(power) * np.sum(other)) * size / 2.0)
    correlation = irfft(moved * given.conj(), size)
    related = correlation.max() / np.sqrt(irfft(power, size)[0] * irfft(other, size)[0])
    if np.arctanh(min(related, 1.0 - EPSILON)) < CHANCE * chance / np.sqrt(len(drive)):
        yield (
            f"displacement {axis} does not follow drive {axis}; record both of one scanner, at"
            " the same time"
        )


def _surely(samples: int, period: float, given: Array, moved: Array) -> bool:
    """Whether moves follow a drive's better so many samples late than as late as they may be.

    They do where what they gain in common is beyond chance, their remainder being noise.
    """
    earliest, latest = -(EARLY / period + 2.0), LATE / period + 2.0
    shifted, allowed = (
        np.roll(given, int(each)) for each in (samples, np.clip(samples, earliest, latest))
    )
    residual = moved - (shifted @ moved) / (shifted @ shifted) * shifted
    change = shifted - allowed
    return bool(change @ moved > CHANCE * float(np.std(residual)) * float(np.linalg.norm(change)))


def _in_step(axis: str, samples: int, period: float) -> Iterator[str]:
    """Find clocks that are apart. Hysteresis delays a motion, yet turns where its drive turns."""
    late = samples * period
    if not -(EARLY + 2.0 * period) < late < LATE + 2.0 * period:
        yield (
            f"displacement {axis} {'lags' if late > 0.0 else 'leads'} its drive by"
            f" {abs(late):.3g} s: the two are not synchronised; start both on one clock,"
            f" or correct the unit of time, if samples do not take {period:.3g} s"
        )


def _sign(axis: str, drive: Array, displacement: Array) -> Iterator[str]:
    """Find a sensor or an amplifier of the other sign, where the drive is too slow to resonate."""
    given, moved = (rfft(signal - signal.mean()) for signal in (drive, displacement))
    power = np.cumsum(np.abs(given) ** 2)
    slow = np.concatenate([[0.0], power[:-1]]) <= SLOWEST * power[-1]
    likeness = np.vdot(given[slow], moved[slow]).real
    if likeness < AGAINST * np.linalg.norm(given[slow]) * np.linalg.norm(moved[slow]):
        yield (
            f"displacement {axis} falls where its drive rises: the sensor or the amplifier has the"
            " other sign; record it with the sign turned, or import it in a unit of the other sign,"
            " as -um"
        )


def offset_at_rest(drive: Array, displacement: Array) -> float:
    """Return the mean displacement (m) until the drive (V) first changes, both (n,); 0 if chance.

    It is chance within CHANCE standard errors of white noise.
    """
    rest = displacement[: max(1, int(np.argmax(drive != drive[0])))]
    mean = float(rest.mean())
    chance = CHANCE * float(rest.std()) / np.sqrt(len(rest))
    return mean if abs(mean) > chance else 0.0


def _lags(
    given: Mapping[str, Array], moved: Mapping[str, Array]
) -> dict[tuple[str, str], tuple[int, float]]:
    """Samples by which each axis' moves best lag each axis' drive, and their correlation.

    The keys are the names of drive and displacement.
    """
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
        found[drive, displacement] = samples, float(correlation[best])
    return found


Mask: TypeAlias = NDArray[np.bool_]

END, FLAT = 0.05, 0.5
"""A record saturates where its slope in this share at an end is below this share of the mean."""
FAR = 0.5
"""Share of the drive's range that a branch covers whose slopes are compared."""
NORMAL_95 = 1.959964
"""97.5th percentile of the standard normal distribution."""
SLOW = 0.9
"""Correlation of drive and displacement from which a record is slow enough to have slopes."""


def saturation_problems(axis: str, drive: Array, displacement: Array) -> Iterator[str]:
    """Yield where a slow record, (n,) in V and m, flattens towards an end of its drive.

    What is at its limit stands still while the drive comes there and while it goes back, for it
    has no memory. Hysteresis bends the two ways apart: it flattens one at most, and loses heat only
    where the other is the steeper. So the steeper way counts, beside the mean slope of the same
    branches. Branches are compared that cover much of the range, as every branch is flat, or
    steep, where it has just turned: those that only go back from an end are compared with the
    beginnings of others. A drive of few steps has no slopes, a ramp but one end. Where the
    displacement goes against its drive the stage follows late, or rings.
    """
    slow = np.corrcoef(drive, displacement)[0, 1] > SLOW
    if not slow or np.mean(np.diff(drive) != 0.0) < 0.5:  # noqa: PLR2004 - most of the time
        return
    near = END * np.ptp(drive)
    for end, there in (("top", drive > drive.max() - near), ("bottom", drive < drive.min() + near)):
        slopes = _slopes(drive, displacement, there)
        if slopes and max(map(abs, slopes)) < FLAT:
            yield (
                f"{axis} saturates: at the {end} of its drive it moves less than {FLAT:.0%} as far"
                f" per volt as elsewhere; record it with less than {np.ptp(drive):.3g} V peak to"
                " peak"
            )


def _slopes(drive: Array, displacement: Array, there: Mask) -> list[float]:
    """Slopes where the drive is ``there``, over the usual ones: of branches that come, and that go.

    None where no branch goes there whose slope could be usual.
    """
    turns = np.concatenate([[0], turning_points(drive), [len(drive) - 1]])
    both = np.stack((drive, displacement))
    long = [
        (both[:, m : n + 1], there[m : n + 1])
        for m, n in pairwise(turns)
        if abs(drive[n] - drive[m]) > FAR * np.ptp(drive)
    ]
    coming, going = (
        [(branch, branch[:, here]) for branch, here in long if here[end] and not here[~end]]
        for end in (-1, 0)
    )
    if coming:
        usual = [_ways([branch for branch, _ in each]) for each in (coming, going)]
    else:
        usual = [_ways([]), _ways([_begun(branch, drive) for branch, here in long if not here[0]])]
    found = []
    for branches, ways in zip((coming, going), usual, strict=True):
        ends = [end for _, end in branches]
        if np.sum(_ways(ends)[:, 0]) > 0.0 and np.all(np.sum(ways, axis=0) != 0.0):
            noise = float(np.std(detrend(ends[-1][1])))
            found.append(float(_most(_ways(ends), noise) * np.divide(*np.sum(ways, axis=0))))
    return found


def _ways(branches: list[Array]) -> Array:
    """How far the drive (V) went along each branch and the displacement (m) with it, (n, 2)."""
    ways = np.array([branch[:, -1] - branch[:, 0] for branch in branches]).reshape(-1, 2)
    return np.asarray(ways * np.sign(ways[:, :1]))


def _begun(branch: Array, drive: Array) -> Array:
    """Return a branch, (2, n), as far from its turn as the end of a range is wide."""
    return branch[:, np.abs(branch[0] - branch[0, 0]) < END * np.ptp(drive)]


def _most(ways: Array, noise: float) -> float:
    """Slope of a displacement over its drive, ways of both (branches, 2): the most it may be.

    What branches differ by is noise and hum, the upper 97.5 % limit Student's. For one branch
    they follow from its scatter about its line, a ``noise`` at both ends of its way.
    """
    slope = float(np.sum(ways[:, 1]) / np.sum(ways[:, 0]))
    if len(ways) == 1:
        return slope + NORMAL_95 * float(np.sqrt(2.0) * noise / np.abs(ways[0, 0]))
    residual = ways[:, 1] - slope * ways[:, 0]
    error = float(np.std(residual, ddof=1) * np.sqrt(len(ways)) / np.abs(np.sum(ways[:, 0])))
    return slope + float(student.ppf(0.975, len(ways) - 1)) * error


def turning_points(drive: Array) -> NDArray[np.int64]:
    """Samples where the drive turns round, the first of each where it pauses there."""
    moving = np.flatnonzero(np.diff(drive))
    rising = np.diff(drive)[moving] > 0.0
    return np.asarray(moving[:-1][rising[:-1] != rising[1:]] + 1, dtype=np.int64)
