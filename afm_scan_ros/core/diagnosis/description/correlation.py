"""Autocorrelation, cross-correlation and coherence of a residual.

The 95 % band of white noise is 1.96 / √N. A correlated residual exceeds it by chance, so a second
band comes from a block bootstrap: stretches of the residual are drawn in random order. This keeps
correlation within a stretch and removes correlation beyond it.
"""

from collections.abc import Sequence

import numpy as np
from attrs import field, frozen
from numpy.typing import NDArray
from scipy.fft import irfft, next_fast_len, rfft
from scipy.signal import csd, welch

from afm_scan_ros.core.types import Array, floats

CONFIDENT = 1.96
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


def autocorrelation(residual: Array, sample_period: float, seed: int) -> Correlation:
    """Correlate a residual (n,) with itself at lags above zero."""
    return _correlation(residual, None, sample_period, seed)


def cross_correlation(
    residual: Array, signal: Array, sample_period: float, seed: int
) -> Correlation:
    """Correlate a residual (n,) with a signal (n,) that comes before it by the lag."""
    return _correlation(residual, signal, sample_period, seed)


def _correlation(
    residual: Array, signal: Array | None, sample_period: float, seed: int
) -> Correlation:
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
