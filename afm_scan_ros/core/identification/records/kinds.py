"""What a drive can identify, recognised stretch by stretch from its shape alone.

Neither its size nor its sample period matters: a hold is long, a move is short and a line is strong
against the record itself.
"""

import numpy as np
from attrs import frozen
from scipy.signal import hilbert

from afm_scan_ros.core.identification.records.periods import is_periodic
from afm_scan_ros.core.types import Array

RESTING = 0.5
"""Share of its samples that a drive rests in, beyond which it steps from hold to hold."""
HOLD = 0.005
"""Share of the record that a hold lasts at least: the steps of a converter are shorter."""
STEP = 0.1
"""A move that lasts less than this share of a hold beside it is a step."""
SINGLE = 0.1
"""Share of its frequency by which a sweep's envelope changes, at most."""
SWEPT = 1.5
"""Ratio of the highest to the lowest frequency from which a sine sweeps."""
BROAD, MOST = 0.05, 0.5
"""Half-width of a line, over its frequency, and the share of the power that makes a scan of it."""
STRAIGHT = 1e-3
"""Bend, over the largest one, below which a drive goes straight on."""
FILLED = 0.9
"""Share of the power in the band of a noise."""
FEWEST_LINES = 30
"""Lines that a noise fills at least."""
SPREAD = 0.2
"""Median over mean power in the band: 0.69 for noise (exponentially distributed), 0 for lines."""

MOVE = "move"
"""What lies between holds, before it is looked at."""


@frozen
class Stretch:
    """Samples ``first`` up to ``last`` of a drive, and their kind.

    It is rest, steps, multisine, sweep, noise, loops or scan.
    """

    kind: str
    first: int
    last: int

    @property
    def samples(self) -> int:
        """How many there are."""
        return self.last - self.first


def recognised(drive: Array) -> str | None:
    """Return what a drive (V), (n,), is for: creep, frequency, or None of these.

    Steps between holds show creep, a multisine, a sweep or noise the frequency response. Of
    several, the one that lasts longest counts; rests do not.
    """
    purposes = {
        "steps": "creep",
        "multisine": "frequency",
        "sweep": "frequency",
        "noise": "frequency",
    }
    found = [stretch for stretch in stretches(drive) if stretch.kind != "rest"]
    if not found:
        return None
    return purposes.get(max(found, key=lambda stretch: stretch.samples).kind)


def stretches(drive: Array) -> tuple[Stretch, ...]:
    """Cut a drive (V), (n,), into stretches of one kind each, in order and without gaps."""
    return tuple(
        Stretch(_kind(drive[part.first : part.last]), part.first, part.last)
        if part.kind == MOVE
        else part
        for part in _stepping(_parts(drive))
    )


def _parts(drive: Array) -> list[Stretch]:
    """Long holds, and the moves between them."""
    edges = np.concatenate([[0], np.flatnonzero(np.diff(drive)) + 1, [len(drive)]])
    runs = np.column_stack([edges[:-1], edges[1:]])
    parts, done = [], 0
    for first, last in runs[np.diff(runs)[:, 0] >= max(HOLD * len(drive), 2)].tolist():
        if first > done:
            parts.append(Stretch(MOVE, done, first))
        parts.append(Stretch("rest", first, last))
        done = last
    return parts if done == len(drive) else [*parts, Stretch(MOVE, done, len(drive))]


def _stepping(parts: list[Stretch]) -> list[Stretch]:
    """Join holds, and the short moves between them, to steps."""
    found: list[Stretch] = []
    for i, part in enumerate(parts):
        beside = [p.samples for p in parts[max(i - 1, 0) : i + 2] if p.kind == "rest"]
        step = part.kind == MOVE and part.samples < STEP * max(beside, default=0)
        follows = part.kind == "rest" and i > 0 and parts[i - 1].kind == "rest"
        before = found[-1].kind if found else None
        joins = part.kind == "rest" if before == "steps" else before == "rest" and follows
        if joins or (step and before in ("rest", "steps")):
            found[-1] = Stretch("steps", found[-1].first, part.last)
        else:
            found.append(Stretch("steps", part.first, part.last) if step else part)
    return found


def _kind(drive: Array) -> str:
    """Recognise what moves without long holds."""
    drive = _turning(drive)
    if is_sweep(drive) and _frequency_ratio(drive) > SWEPT and not _has_one_rate(drive):
        return "sweep"
    if is_periodic(drive[:, np.newaxis]):
        return "scan" if _has_one_rate(drive) else "multisine"
    random = _is_binary(drive) or (_bends(drive) and _fills_a_band(drive))
    return "noise" if random else "loops"


def is_sweep(drive: Array) -> bool:
    """Whether a drive, (n,), is a single sine at a time, its envelope slow beside it."""
    analytic = hilbert(drive - drive.mean())
    envelope = np.abs(analytic)
    turning = np.abs(np.diff(analytic))
    return bool(np.abs(np.diff(envelope)).sum() < SINGLE * turning.sum())


def _is_binary(drive: Array) -> bool:
    """Whether a drive switches between two levels, as a pseudo-random binary sequence does."""
    levels = np.unique(drive)
    return bool(len(levels) == 2 and np.count_nonzero(np.diff(drive)) >= FEWEST_LINES)  # noqa: PLR2004 - two


def _turning(drive: Array) -> Array:
    """Return a drive from its first turn to its last, without the ways from and to rest."""
    ways = np.sign(np.diff(drive))
    moves = np.flatnonzero(ways)
    turns = moves[1:][np.diff(ways[moves]) != 0.0]
    return drive[turns[0] : turns[-1] + 1] if len(turns) > 1 else drive


def _has_one_rate(drive: Array) -> bool:
    """Whether most of a drive's power is in one line, as that of a scan or of a sine is."""
    power = np.abs(np.fft.rfft((drive - drive.mean()) * np.hanning(len(drive)))) ** 2
    peak = int(np.argmax(power))
    near = max(2, int(BROAD * peak))
    return bool(power[max(peak - near, 0) : peak + near + 1].sum() > MOST * power.sum())


def _frequency_ratio(drive: Array) -> float:
    """Highest over lowest frequency of a single sine, a tenth of its cycles left out at each."""
    phase = np.unwrap(np.angle(hilbert(drive - drive.mean())))
    crossings = np.searchsorted(phase, np.arange(phase[0], phase[-1], 2.0 * np.pi))
    lengths = np.diff(np.unique(crossings))
    low, high = np.quantile(lengths, [0.1, 0.9]) if len(lengths) else (1.0, 1.0)
    return float(high / low)


def _bends(drive: Array) -> bool:
    """Whether a drive hardly ever goes straight on, as moves between levels do."""
    bend = np.abs(np.diff(drive, 2))
    return bool(np.mean(bend < STRAIGHT * bend.max()) < RESTING) if len(bend) else False


def _fills_a_band(drive: Array) -> bool:
    """Whether the power is spread over a band as noise spreads it."""
    power = np.abs(np.fft.rfft(drive - drive.mean())) ** 2
    total = np.cumsum(power)
    tail = (1.0 - FILLED) / 2.0
    first, last = np.searchsorted(total, np.array([tail, 1.0 - tail]) * total[-1])
    band = power[first : last + 1]
    return len(band) >= FEWEST_LINES and bool(np.median(band) > SPREAD * band.mean())
