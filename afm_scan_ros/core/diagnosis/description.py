"""Statistics of a residual: correlation, coherence, dependence on the motion, repetition.

The 95 % band of white noise is 1.96 / √N. A correlated residual exceeds it by chance, so a second
band comes from a block bootstrap: stretches of the residual are drawn in random order. This keeps
correlation within a stretch and removes correlation beyond it.

A scan's residual is split into parts that repeat from line to line and parts that do not, and into
parts common to trace and retrace and parts that differ.
"""

from collections.abc import Sequence

import numpy as np
from attrs import field, frozen
from numpy.typing import NDArray
from scipy.fft import irfft, next_fast_len, rfft
from scipy.ndimage import maximum_filter1d, minimum_filter1d
from scipy.signal import csd, welch

from afm_scan_ros.core.model import CONFIDENT
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.trajectory import TO_AND_FRO, phases
from afm_scan_ros.core.types import Array, floats

MOST = 2**15
"""Largest number of samples; a longer record is averaged over equal stretches."""
LAGS = 120
STRETCHES = 32
"""A record is cut into so many for the bootstrap, and lags reach the length of two of them."""
DRAWS = 40
LEVEL = 0.95


@frozen(eq=False)
class Correlation:
    """Correlation ``values`` (m,) at ``lags`` (m,) in s, and two bands of 95 % about zero.

    ``white`` is that of white noise. ``bootstrap`` is that of the block bootstrap, for lags beyond
    one stretch, which are marked in ``distant`` (m,).
    """

    lags: Array
    values: Array
    white: float
    bootstrap: float
    distant: NDArray[np.bool_]

    @property
    def outside_white(self) -> float:
        """Share of the lags outside the band of white noise."""
        return float(np.mean(np.abs(self.values) > self.white))

    @property
    def outside_bootstrap(self) -> float:
        """Share of the distant lags outside the band of the block bootstrap."""
        return float(np.mean(np.abs(self.values[self.distant]) > self.bootstrap))


def correlation(
    residual: Array, signal: Array | None, sample_period: float, seed: int
) -> Correlation:
    """Correlate a residual (n,) with a ``signal`` (n,) that comes before it by the lag.

    Without a signal, correlate the residual with itself, at lags above zero.
    """
    every = -(-len(residual) // MOST)
    left = _standard(_averaged(residual, every))
    other = None if signal is None else _standard(_averaged(signal, every))
    stretch = len(left) // STRETCHES
    lags = _lags(2 * stretch)
    distant = np.asarray(lags > stretch)
    drawn = (_drawn(left, stretch, seed + k) for k in range(DRAWS))
    chance = [np.abs(_at(lags[distant], each, other)) for each in drawn]
    return Correlation(
        np.asarray(lags * (every * sample_period)),
        _at(lags, left, other),
        float(CONFIDENT / np.sqrt(len(left))),
        float(np.quantile(chance, LEVEL)),
        distant,
    )


def _lags(longest: int) -> NDArray[np.int64]:
    """Return lags from one sample on, dense at first."""
    return np.unique(np.geomspace(1, longest, LAGS).astype(np.int64))


def _at(lags: NDArray[np.int64], left: Array, other: Array | None) -> Array:
    size = next_fast_len(2 * len(left), real=True)
    spectrum = rfft(left, size)
    reference = spectrum if other is None else rfft(other, size)
    products = irfft(spectrum * np.conj(reference), size)
    return np.asarray(products[lags] / len(left))


def _drawn(left: Array, stretch: int, seed: int) -> Array:
    starts = np.random.default_rng(seed).integers(0, len(left), STRETCHES)
    return np.asarray(left[(starts[:, np.newaxis] + np.arange(stretch)).ravel() % len(left)])


def _averaged(signal: Array, every: int) -> Array:
    whole = len(signal) // every * every
    return np.asarray(signal[:whole].reshape(-1, every).mean(axis=1))


def _standard(signal: Array) -> Array:
    centred = signal - signal.mean()
    return np.asarray(centred / max(float(centred.std()), np.finfo(float).tiny))


SEGMENTS = 16
"""A record is cut into so many, half overlapping."""
CHANCE = 0.05


@frozen(eq=False)
class Coherence:
    """Coherence, 0 to 1, in n bands between n + 1 ``edges`` (Hz), weighted by the residual's power.

    A band narrower than a line of the spectrum has NaN. Two unrelated signals exceed ``chance``
    in one line of twenty. A residual that repeats with the scan is coherent with the drive.
    """

    edges: tuple[float, ...] = field(converter=floats)
    values: Array
    chance: float


def coherence(
    residual: Array, signal: Array, sample_period: float, edges: Sequence[float]
) -> Coherence:
    """Coherence of a residual (n,) with a signal (n,)."""
    options = {"fs": 1.0 / sample_period, "nperseg": 2 * len(residual) // (SEGMENTS + 1)}
    frequency, own = welch(residual, **options)
    power = welch(signal, **options)[1]
    cross = np.abs(csd(residual, signal, **options)[1]) ** 2
    shared = cross / np.maximum(power, np.finfo(float).tiny)
    band = np.clip(np.searchsorted(edges, frequency, "right") - 1, 0, len(edges) - 2)
    sums = [np.bincount(band, of, len(edges) - 1) for of in (shared, own)]
    with np.errstate(invalid="ignore", divide="ignore"):
        values = np.where(sums[1] > 0.0, sums[0] / sums[1], np.nan)
    return Coherence(tuple(edges), values, float(1.0 - CHANCE ** (1.0 / (SEGMENTS - 1))))


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
