"""Whether a residual is white, and whether it goes with a signal, at any lag.

The 95 % band of white noise is 1.96 / √N. A residual that has a memory of its own exceeds it by
chance; so another band comes from a block bootstrap: stretches of the residual are drawn anew in
random order, which keeps what lies within a stretch and breaks what goes beyond it.
"""

import numpy as np
from attrs import frozen
from numpy.typing import NDArray
from scipy.fft import irfft, next_fast_len, rfft

from afm_scan_ros.core.types import Array

CONFIDENT = 1.96
MOST = 2**15
"""Samples kept; a longer record is averaged over equal stretches."""
LAGS = 120
STRETCHES = 32
"""A record is cut into so many for the bootstrap, and lags reach the length of two of them."""
DRAWS = 40
LEVEL = 0.95


@frozen(eq=False)
class Correlation:
    """Correlation ``values`` (m,) at ``lags`` (m,) in s, and two bands of 95 % about zero.

    ``white`` is that of white noise; ``bootstrap`` that of a residual which keeps its memory of a
    stretch, at lags beyond one: all of ``distant`` (m,).
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
