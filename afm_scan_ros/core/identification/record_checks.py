"""What is wrong with a record, in words that name it and say what to record instead.

Each check may take for granted that those before it found nothing.
"""

from collections.abc import Iterator

import numpy as np

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import AXES, Array, Trace

FARTHEST = 1e-3
"""m; no piezoscanner goes as far."""
HIGHEST = 1e3
"""V; no piezo's drive, before its amplifier, is as high."""
RAIL = 16
"""Samples in succession at the very same extreme that noise does not leave to chance."""
EARLY, LATE = 1e-3, 1e-2
"""Seconds by which the displacement may seem to lead and lag: vibration and hysteresis delay it."""
CHANCE = 6.0
"""Correlation from which signals are related, in standard deviations of that of unrelated noise."""
ORIGIN = 0.05
"""Share of the whole motion by which the first rest may be off zero."""
AGAINST = -0.5
"""Correlation of drive and displacement that no delay or resonance explains."""
END, FLAT = 0.05, 0.5
"""A record saturates where its slope in this share at an end is below this share of the mean."""


def problems(drive: Trace, displacement: Trace) -> Iterator[str]:
    """Yield what keeps a drive (V) and a displacement (m) from being one record, worst first."""
    yield from _pairing(drive, displacement)
    for quantity, trace in (("drive", drive), ("displacement", displacement)):
        for axis in AXES:
            yield from _bad_numbers(f"{quantity} {axis}", trace.axis(axis))
    yield from _at_rest(drive, displacement)
    yield from _units(drive, displacement)
    for axis in AXES:
        yield from _clipped(axis, drive.axis(axis), displacement.axis(axis))
        yield from _sign(axis, drive.axis(axis), displacement.axis(axis))
    for axis, other in zip(AXES, reversed(AXES), strict=True):
        yield from _follows(axis, other, drive, displacement)
    for axis in AXES:
        yield from _origin(axis, drive.axis(axis), displacement.axis(axis))


def refuse_saturated(name: str, axis: str, drive: Array, displacement: Array) -> None:
    """Raise InputError where a slow record, (n,) in V and m, flattens towards an end of its drive.

    Hysteresis steepens a loop towards its ends; an amplifier or a stage at its limit flattens it.
    """
    move, follow = np.diff(drive), np.diff(displacement)
    near = END * np.ptp(drive)
    ends = {
        "top": (move > 0.0) & (drive[1:] > drive.max() - near),
        "bottom": (move < 0.0) & (drive[1:] < drive.min() + near),
    }
    for end, there in ends.items():
        same_way = move * np.sign(move[there].sum()) > 0.0
        slope = follow[there].sum() / move[there].sum()
        if slope < FLAT * follow[same_way].sum() / move[same_way].sum():
            raise InputError(
                f"record {name}: {axis} saturates: at the {end} of its drive it moves less than"
                f" {FLAT:.0%} as far per volt as elsewhere; record it with less than"
                f" {np.ptp(drive):.3g} V peak to peak"
            )


def _pairing(drive: Trace, displacement: Trace) -> Iterator[str]:
    if drive.sample_period != displacement.sample_period:
        yield (
            f"drive every {drive.sample_period:g} s, displacement every"
            f" {displacement.sample_period:g} s; record both at one sample period"
        )
    if len(drive.x) != len(displacement.x):
        yield (
            f"{len(drive.x)} drive samples, {len(displacement.x)} displacement samples;"
            " record the scan to its end"
        )
    if drive.first_sample or displacement.first_sample:
        yield "it begins in the middle of a scan; record it from its first sample"


def _bad_numbers(quantity: str, values: Array) -> Iterator[str]:
    wrong = np.flatnonzero(~np.isfinite(values))
    if wrong.size:
        yield f"{quantity} is {values[wrong[0]]} at sample {wrong[0]}; record it again"


def _at_rest(drive: Trace, displacement: Trace) -> Iterator[str]:
    resting = [axis for axis in AXES if _rests(drive.axis(axis))]
    if len(resting) == 1:
        moving = next(axis for axis in AXES if axis not in resting)
        yield (
            f"drive {resting[0]} never changes: this is a record of {moving} alone; drive both"
            " axes in one record"
        )
    for quantity, trace in (("drive", drive), ("displacement", displacement)):
        for axis in AXES:
            if _rests(trace.axis(axis)):
                yield f"{quantity} {axis} never changes: nothing to fit; record it again"


def _rests(values: Array) -> bool:
    return values.size == 0 or float(np.ptp(values)) == 0.0


def _units(drive: Trace, displacement: Trace) -> Iterator[str]:
    for axis in AXES:
        farthest = float(np.abs(displacement.axis(axis)).max())
        if farthest > FARTHEST:
            yield (
                f"displacement {axis} reaches {farthest:.3g} m, and no scanner moves by more than"
                f" {FARTHEST:g} m: is it in µm or in the sensor's V? record it in m"
            )
        highest = float(np.abs(drive.axis(axis)).max())
        if highest > HIGHEST:
            yield (
                f"drive {axis} reaches {highest:.3g} V, above {HIGHEST:g} V: is it in mV?"
                " record it in V"
            )


def _origin(axis: str, drive: Array, displacement: Array) -> Iterator[str]:
    """Find a sensor whose zero is elsewhere."""
    rest = displacement[: int(np.argmax(drive != drive[0]))].mean()
    if abs(rest) > ORIGIN * np.ptp(displacement):
        yield (
            f"displacement {axis} begins at {rest:.3g} m; take the sensor's zero where the record"
            " begins, at the scanner's depolarised rest"
        )


def _sign(axis: str, drive: Array, displacement: Array) -> Iterator[str]:
    """Find a sensor or an amplifier of the other sign."""
    if np.corrcoef(drive, displacement)[0, 1] < AGAINST:
        yield (
            f"displacement {axis} falls where its drive rises: the sensor or the amplifier has the"
            " other sign; record it with the sign turned"
        )


def _clipped(axis: str, drive: Array, displacement: Array) -> Iterator[str]:
    """Find the sensor at its rail: noise does not give the same extreme many times in a row."""
    if np.mean(np.diff(displacement) == 0.0) > 0.5:  # noqa: PLR2004 - too coarse to tell
        return
    driven = drive != drive[0]
    for end, rail in (("lower", displacement.min()), ("upper", displacement.max())):
        free = np.flatnonzero((displacement != rail) | ~driven)
        runs = np.diff(free, prepend=-1, append=len(displacement)) - 1
        if runs.max() >= RAIL:
            first = int(np.append(-1, free)[runs.argmax()]) + 1
            yield (
                f"displacement {axis} is clipped at its {end} end, {rail:.4g} m, for {runs.max()}"
                f" samples from sample {first}; record it with less drive or a wider sensor range"
            )


def _follows(axis: str, other: str, drive: Trace, displacement: Trace) -> Iterator[str]:
    moves = np.diff(displacement.axis(axis))
    lag, own = _lag(np.diff(drive.axis(axis)), moves)
    chance = CHANCE / np.sqrt(len(moves))
    foreign = _lag(np.diff(drive.axis(other)), moves)[1]
    if foreign > max(2.0 * own, chance):
        yield (
            f"displacement {axis} follows drive {other}: it is a record of axis {other}; connect"
            " the axes as they are named and record again"
        )
    if own < chance:
        yield (
            f"displacement {axis} does not follow drive {axis}; record both of one scanner, at"
            " the same time"
        )
    period = drive.sample_period
    if not -(EARLY + 2.0 * period) < lag * period < LATE + 2.0 * period:
        yield (
            f"displacement {axis} {'lags' if lag > 0 else 'leads'} its drive by"
            f" {abs(lag) * period:.3g} s: the two are not synchronised; start both on one clock"
        )


def _lag(moves: Array, follow: Array) -> tuple[int, float]:
    """Samples by which ``follow`` is best delayed against ``moves``, and their correlation then."""
    size = 1 << (2 * len(moves) - 1).bit_length()
    spectrum = np.fft.rfft(follow, size) * np.fft.rfft(moves, size).conj()
    correlation = np.fft.irfft(spectrum, size)
    best = int(np.argmax(correlation))
    scale = np.sqrt((moves @ moves) * (follow @ follow))
    return best - size * (best > size // 2), float(correlation[best] / scale)
