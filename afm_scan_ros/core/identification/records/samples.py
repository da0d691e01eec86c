"""Samples that are no measurement: lost, repeated, held, disturbed, or of a sensor at rest.

A predictor, fitted to the record itself, predicts each sample from those before it, their squares
and cubes, and the drive. Mechanics, springs that harden or soften, hysteresis and sensor noise keep
to it, whatever they are like; what a recorder or a converter does to single samples does not.
"""

from collections.abc import Iterator

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from scipy.ndimage import median_filter
from scipy.special import erf

from afm_scan_ros.core.types import Array

ORDER = 12
"""Samples that a prediction stands on."""
POWERS, CURVED = (2, 3), 6
"""Powers of the displacement that a prediction stands on too, and of how many samples."""
ROWS = 50_000
"""Predictions that fit the predictor, at most."""
RESOLVED = 0.01
"""Directions of the past weaker than this share of the strongest are left out: they would make a
kink of the drive large."""
BLOCK = 100
"""Samples over which the usual error is taken."""
NORMAL = 1.4826
"""Standard deviation of normal noise over the median of its size."""
OFF = 15.0
"""Error over the usual one that no noise reaches."""
RESTING = 0.5
"""Share of its samples that a drive rests in, beyond which it steps."""
LOOKED, VARIED = 16, 0.5
"""Samples that show whether a stretch repeats, and the share of them that must change for it."""


def course_problems(axis: str, drive: Array, displacement: Array) -> Iterator[str]:
    """Yield where a displacement (m) under a drive (V), both (n,), first leaves its course.

    What the drive itself does unforeseen, as where one multisine follows another, explains as much
    as the predictor expects it to move the displacement: a loop's gain is at most twice the mean.
    """
    if len(drive) <= BLOCK:
        return
    error, explained = _prediction_error(drive, displacement)
    usual = _usual(error, displacement)
    settled = ~(_stepping(drive) | _kinked(drive))[-len(error) :]
    found = np.flatnonzero((np.abs(error) > OFF * usual + explained) & settled)
    if found.size:
        first = int(found[0])
        sample = first + len(drive) - len(error)
        yield (
            f"displacement {axis} {_what(displacement, sample)} at sample {sample}: it is"
            f" {1e9 * abs(error[first]):.3g} nm off its course, some {1e9 * usual[first]:.2g} nm"
            " are usual; record it again, or give what is before and after as two records"
        )


def _prediction_error(drive: Array, displacement: Array) -> tuple[Array, Array]:
    """How far each but the first samples lies from where those before and the drive lead, m.

    And how much of it an unforeseen drive explains: what the drive does besides what it did
    before, times its weights in the prediction.
    """
    given, moved = (np.diff(signal) / np.std(np.diff(signal)) for signal in (drive, displacement))
    past, driven = (sliding_window_view(signal, ORDER + 1) for signal in (moved, given))
    curved = _curved(displacement)
    rows = np.linspace(0, len(past) - 1, min(ROWS, len(past))).astype(int)
    regressors = [past[rows, :-1], driven[rows], *(each[rows] for each in curved)]
    predictor = np.split(
        _weights(np.hstack(regressors), past[rows, -1]),
        np.cumsum([each.shape[1] for each in regressors])[:-1],
    )
    own, other = np.append(predictor[0], -1.0), predictor[1]
    error = np.convolve(moved, own[::-1], "valid") + np.convolve(given, other[::-1], "valid")
    error += sum(each @ weights for each, weights in zip(curved, predictor[2:], strict=True))
    usual = np.append(_weights(driven[rows, :-1], driven[rows, -1]), -1.0)
    unforeseen = np.abs(np.convolve(given, usual[::-1], "valid"))
    unforeseen = np.concatenate([np.abs(given[:ORDER]), unforeseen])
    explained = np.convolve(unforeseen, np.abs(other)[::-1], "valid")
    scale = np.std(np.diff(displacement))
    return np.asarray(scale * error), np.asarray(scale * explained)


def _curved(displacement: Array) -> list[Array]:
    """Differences (n, CURVED) of each power of the displacement (m) before each prediction."""
    centred = displacement - np.mean(displacement)
    steps = (np.diff((centred / np.max(np.abs(centred))) ** power) for power in POWERS)
    return [
        sliding_window_view(step / np.std(step), ORDER + 1)[:, ORDER - CURVED : -1]
        for step in steps
    ]


def _weights(past: Array, now: Array) -> Array:
    return np.asarray(np.linalg.lstsq(past, now, rcond=RESOLVED)[0])


def _usual(error: Array, displacement: Array) -> Array:
    """Return the errors' usual size about each, and at least what the sensor resolves.

    About each are those near it in time, those of motion as far from the mean, and those of motion
    as fast: what the predictor does not know of the scanner grows with both.
    """
    size = np.abs(error)
    far = _largest(np.abs(displacement - np.mean(displacement))[1:])
    fast = _largest(np.abs(np.diff(displacement)))
    each = _usual_in_time(size, displacement), _alike(size, far), _alike(size, fast)
    return np.asarray(np.max(each, axis=0))


def _largest(size: Array) -> Array:
    """Return the largest of the samples that each prediction stands on, and of its own."""
    return np.asarray(np.max(sliding_window_view(size, ORDER + 1), axis=1))


def _alike(size: Array, of: Array) -> Array:
    """Return the usual size (n,) of those whose value ``of`` (n,) is nearest to each one's.

    It is at most that of any larger value, or samples that are held would be usual at rest.
    """
    order, usual = np.argsort(of), np.empty(len(size))
    found = NORMAL * median_filter(size[order], BLOCK, mode="reflect")
    usual[order] = np.minimum.accumulate(found[::-1])[::-1]
    return np.asarray(usual)


def _usual_in_time(size: Array, displacement: Array) -> Array:
    whole = len(size) // BLOCK * BLOCK
    local = NORMAL * np.median(size[:whole].reshape(-1, BLOCK), axis=1)
    near = np.max([np.roll(local, shift) for shift in (-1, 0, 1)], axis=0)
    steps = np.abs(np.diff(displacement))
    least = max(NORMAL * float(np.median(size)), float(steps[steps > 0.0].min()))
    block = np.minimum(np.arange(len(size)) // BLOCK, len(near) - 1)
    return np.asarray(np.maximum(near[block], least))


def _stepping(drive: Array) -> NDArray[np.bool_]:
    """Return where a drive that mostly rests is within twice a prediction's past of a move.

    Such moves are too few for the predictor to learn what they do.
    """
    moved = np.diff(drive, prepend=drive[0]) != 0.0
    if np.mean(moved) > 1.0 - RESTING:
        return np.zeros_like(moved)
    return np.convolve(moved, np.ones(2 * ORDER))[: len(moved)] > 0.0


def _kinked(drive: Array) -> NDArray[np.bool_]:
    """Return where a drive is within twice a prediction's past of a kink that it seldom has.

    The predictor is not fitted to what rings after such a kink.
    """
    bend = np.abs(np.diff(drive, 2, prepend=[drive[0]] * 2))
    kinks = bend > OFF * NORMAL * np.median(bend)
    rare = kinks & (np.mean(kinks) < 1.0 / BLOCK)
    return np.convolve(rare, np.ones(2 * ORDER))[: len(rare)] > 0.0


def _what(displacement: Array, sample: int) -> str:
    """Name what happens at a sample where the course is left."""
    speed = displacement[sample - 1] - displacement[sample - 2]
    leap = displacement[sample] - displacement[sample - 1]
    after = displacement[min(sample + 1, len(displacement) - 1)] - displacement[sample - 1]
    if abs(after - 2.0 * speed) < abs(leap - speed) / 2.0:
        return "has a spike"
    if _occurred(displacement, sample):
        return "repeats what was before"
    return "jumps, as if samples were lost, held or disturbed,"


def _occurred(displacement: Array, sample: int) -> bool:
    """Whether what follows a sample has been there before, in more steps than chance repeats."""
    steps = np.diff(displacement[sample - 1 : sample + LOOKED])
    part = displacement[sample : sample + LOOKED]
    if np.count_nonzero(steps) < VARIED * LOOKED or sample < 2 * LOOKED:
        return False
    starts = np.flatnonzero(displacement[: sample - LOOKED] == part[0])
    return any(np.array_equal(displacement[s : s + LOOKED], part) for s in starts)


SHORTEST = 16
"""Samples of one value, fewer than which show nothing."""
OFTENER = 6
"""How many times as often as the values next to it an extreme is never read: at turns, thrice."""
NEXT = 8
"""Values that are next to an extreme."""
VISIBLE = 0.5
"""Share of the readings at rest that equal the one before, beyond which noise does not show."""
FEWEST = 100
"""Samples at rest, fewer than which do not show whether there is noise."""
BEYOND_CHANCE = 2.0
"""Length of a run of one value over the longest that noise leaves to chance."""


def sensor_problems(axis: str, drive: Array, displacement: Array) -> Iterator[str]:
    """Yield where a displacement (m) stands still under a drive (V), both (n,), of an axis.

    Where noise does not show, it may do so for as long as the drive rests.
    """
    equal = _equal_at_rest(drive, displacement)
    shows = equal < VISIBLE
    moving = np.append(np.diff(drive) != 0.0, False) | shows
    yield from _clipped(axis, displacement, moving)
    if shows:
        yield from _unread(axis, displacement, equal)


def _clipped(axis: str, displacement: Array, moving: NDArray[np.bool_]) -> Iterator[str]:
    """Find an extreme that is read again and again, the values next to it but now and then."""
    values, counts = np.unique(displacement[moving], return_counts=True)
    if len(values) <= NEXT:
        return
    ends = {"lower": (0, counts[1 : NEXT + 1]), "upper": (-1, counts[-NEXT - 1 : -1])}
    for end, (rail, others) in ends.items():
        if counts[rail] >= SHORTEST and counts[rail] > OFTENER * others.max():
            first = int(np.argmax(displacement == values[rail]))
            yield (
                f"displacement {axis} is clipped at its {end} end, {values[rail]:.4g} m, in"
                f" {counts[rail]} samples from sample {first} on; record it with less drive or a"
                " wider sensor range, or leave out the samples if the value marks missing ones"
            )


def _unread(axis: str, displacement: Array, equal: float) -> Iterator[str]:
    """Find the longest run of one reading, where noise repeats one with probability ``equal``.

    That is the mean over all places of rest: q / (2 √π s), for normal noise of rms s and steps of q
    of the sensor. Midway of a step the same is read with probability erf(q / (2 √2 s)).
    """
    edges = np.concatenate([[0], np.flatnonzero(np.diff(displacement)) + 1, [len(displacement)]])
    longest = int(np.argmax(np.diff(edges)))
    first, length = edges[longest], np.diff(edges)[longest]
    midway = erf(np.sqrt(np.pi / 2.0) * max(equal, 1.0 / len(displacement)))
    chance = np.log(len(displacement)) / -np.log(midway)
    if length > max(SHORTEST, BEYOND_CHANCE * chance):
        yield (
            f"displacement {axis} stands still at {displacement[first]:.4g} m for {length} samples"
            f" from sample {first}: the sensor was not read; record it again, without a gap"
        )


def _equal_at_rest(drive: Array, displacement: Array) -> float:
    """Share of the readings that equal the one before while the drive rests; 1 if unknown.

    It is that of the rest before the first move, if there is one, as creep follows a move.
    """
    resting = np.diff(drive) == 0.0
    before = np.logical_and.accumulate(resting)
    resting = before if np.count_nonzero(before) >= FEWEST else resting
    if np.count_nonzero(resting) < FEWEST:
        return 1.0
    return float(np.mean(np.diff(displacement)[resting] == 0.0))
