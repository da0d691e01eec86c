"""Dependence of a residual on position, speed and time, and its repetition over the lines.

A scan's residual is split into parts that repeat from line to line and parts that do not, and into
parts common to trace and retrace and parts that differ.
"""

import numpy as np
from attrs import frozen
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d, minimum_filter1d

from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.trajectory import phases
from afm_scan_ros.core.trajectory.kinds import TO_AND_FRO
from afm_scan_ros.core.types import Array

BINS = 60
NEIGHBOURHOOD = 32
"""Share of the record, one in so many, over which its motion's amplitude is taken."""
LEAST_TURN = 1e-3
"""Least share of the whole motion between two turning points."""


@frozen(eq=False)
class Dependence:
    """Mean and rms (m) of a residual in bins of a quantity, at their ``centres``; all (bins,).

    ``unit`` is the quantity's. ``share`` of the mean square is explained by the bins' means.
    Empty bins are left out.
    """

    unit: str
    centres: Array
    mean: Array
    rms: Array
    count: NDArray[np.int64]
    share: float


def dependences(residual: Array, moved: Array, sample_period: float) -> dict[str, Dependence]:
    """Bin a residual (n,) over quantities of the predicted motion ``moved`` (n,) in m."""
    quantities: dict[str, tuple[str, Array]] = {
        "position": ("m", moved),
        "speed": ("m/s", np.asarray(np.gradient(moved, sample_period))),
        "travel": ("m", _travel(moved)),
        "amplitude": ("m", _amplitude(moved)),
        "time": ("s", np.asarray(np.arange(len(moved)) * sample_period)),
    }
    return {name: _binned(residual, *of) for name, of in quantities.items()}


def _binned(residual: Array, unit: str, quantity: Array) -> Dependence:
    edges = np.linspace(quantity.min(), quantity.max(), BINS + 1)
    where = np.clip(np.searchsorted(edges, quantity, "right") - 1, 0, BINS - 1)
    count = np.bincount(where, minlength=BINS)
    held = count > 0
    number = count[held]
    mean = np.bincount(where, residual, BINS)[held] / number
    square = np.bincount(where, residual**2, BINS)[held] / number
    whole = max(float(residual @ residual), np.finfo(float).tiny)
    centres = (0.5 * (edges[1:] + edges[:-1]))[held]
    return Dependence(unit, centres, mean, np.sqrt(square), number, float(number @ mean**2) / whole)


def _travel(moved: Array) -> Array:
    """Travel (m) since the last turning point, on which hysteresis and play depend."""
    turns = [0, *_turns(moved)]
    lengths = np.diff([*turns, len(moved)])
    return np.asarray(np.abs(moved - np.repeat(moved[turns], lengths)))


def _turns(moved: Array) -> list[int]:
    """Samples of the turning points of a motion, small oscillations ignored."""
    least = LEAST_TURN * float(np.ptp(moved))
    extremes = 1 + np.flatnonzero(np.diff(np.sign(np.diff(moved))))
    turns: list[int] = []
    for sample in extremes:
        if abs(moved[sample] - moved[turns[-1] if turns else 0]) > least:
            turns.append(int(sample))
    return turns


def _amplitude(moved: Array) -> Array:
    """Half of peak to peak (m) of the motion near each sample."""
    window = max(3, len(moved) // NEIGHBOURHOOD)
    return np.asarray(0.5 * (maximum_filter1d(moved, window) - minimum_filter1d(moved, window)))


FEWEST = 2
"""Least number of lines after the first for a split into repeating parts."""


@frozen(eq=False)
class Locked:
    """Shares of the residual's mean square on the lines after the first; they add up to 1.

    ``to_scan`` repeats from line to line, ``to_time`` is constant on a line but differs between
    lines, ``rest`` is neither.
    """

    to_scan: float
    to_time: float
    rest: float


@frozen(eq=False)
class ToAndFro:
    """The mean line's residual (n,) on ``trace`` and, at the same places, on ``retrace``, in m.

    ``place`` (n,) runs from 0 to 1 along the trace.
    """

    place: Array
    trace: Array
    retrace: Array

    @property
    def equivalent(self) -> float:
        """Rms (m) of the part common to trace and retrace, which depends on position."""
        return float(np.sqrt(np.mean((0.5 * (self.trace + self.retrace)) ** 2)))

    @property
    def unlike(self) -> float:
        """Rms (m) of half the difference of trace and retrace, which depends on direction."""
        return float(np.sqrt(np.mean((0.5 * (self.trace - self.retrace)) ** 2)))


def locked(residual: Array, spec: ScanSpec) -> Locked | None:
    """Split the residual (m) of a whole scan; None where there are too few lines."""
    lines = _lines(residual, spec)
    if lines is None:
        return None
    count = len(lines)
    by_time, by_scan = lines.mean(axis=1, keepdims=True), lines.mean(axis=0)
    rest = float(np.mean((lines - by_time - by_scan) ** 2)) * count / (count - 1)
    seen = max(0.0, float(np.mean(by_scan**2)) - rest / count)
    parts = np.array([seen, float(np.mean(by_time**2)), rest])
    return Locked(*(parts / max(float(parts.sum()), np.finfo(float).tiny)).tolist())


def to_and_fro(residual: Array, spec: ScanSpec) -> ToAndFro | None:
    """Mean trace and retrace; None for patterns that have none, or where lines are too few."""
    lines = _lines(residual, spec)
    if lines is None or spec.pattern not in TO_AND_FRO:
        return None
    mean, half = lines.mean(axis=0), spec.samples_per_line // 2
    return ToAndFro(np.arange(half) / half, mean[:half], np.roll(mean[::-1], 1)[:half])


def _lines(residual: Array, spec: ScanSpec) -> Array | None:
    """Lines after the first, (lines, samples), about their common mean."""
    period = spec.samples_per_line
    where = phases(spec).lines
    count = (min(len(residual), where.stop) - where.start) // period - 1
    if count < FEWEST:
        return None
    first = where.start + period
    lines = residual[first : first + count * period].reshape(count, period)
    return np.asarray(lines - lines.mean())
