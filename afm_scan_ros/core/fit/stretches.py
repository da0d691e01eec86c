"""Stretches over which a record is so smooth that one row of derivatives stands for them.

Derivatives, known by their means over stretches, pass through a bank of poles (``dynamics.py``).

A signal is smooth at a scale where means over 2n samples foretell those over n. With the means m_k,
the half of the difference of both halves of stretch k is that of the quintic through the means,

    p_k = (22 (m_{k-1} - m_{k+1}) - 3 (m_{k-2} - m_{k+2})) / 128,

and the detail, what p_k misses, is that of the biorthogonal wavelet (1, 5). Of white noise of the
variance σ² a sample it has the variance (1/2 + (22² + 3²) / 128²) σ² / n.
Source: A. Cohen, I. Daubechies and J.-C. Feauveau, Comm. Pure Appl. Math. 45 (1992) 485, table 6.1.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.fit.settings import FitSettings
from afm_scan_ros.core.types import Array, Complex

Edges = NDArray[np.intp]
"""Where each stretch begins, and where the last one ends, (stretches + 1,)."""

FORETOLD = np.array([-3.0, 22.0, 0.0, -22.0, 3.0]) / 128.0
"""Weights of m_{k-2} to m_{k+2} in p_k."""


def averaged(signal: Array, block: int) -> Array:
    """Means over blocks, shape (blocks, …)."""
    count = len(signal) // block
    return np.asarray(signal[: count * block].reshape(count, block, *signal.shape[1:]).mean(axis=1))


def means(signal: Array, edges: Edges) -> Array:
    """Means over stretches, shape (stretches, …)."""
    lengths = np.diff(edges).reshape(-1, *[1] * (signal.ndim - 1))
    return np.asarray(np.add.reduceat(signal[: edges[-1]], edges[:-1]) / lengths)


def smooth_edges(
    drive: Array,
    displacement: Array,
    noise: float,
    half_range: float,
    first: int,
    settings: FitSettings,
) -> Edges:
    """Edges of the longest stretches, of powers of two, over which both signals are smooth.

    Both have the shape (n,); ``noise`` is the standard deviation of the displacement (m),
    ``half_range`` that of the operator (V). Sample ``first`` begins a stretch.
    """
    longest = max(len(drive) // settings.smooth_window, 1).bit_length()
    least, most = settings.bend * float(np.std(drive)), settings.smooth_move * half_range
    test = _Smoothness(drive, displacement, noise, least, most, settings)
    parts = (0, first), (first, len(drive))
    found = [edge for part in parts for edge in test.split(*part, 1 << longest)]
    return np.array([*found, len(drive)], np.intp)


@frozen(eq=False)
class _Smoothness:
    """A test of signals, of which the drive's details may have a ``least`` size (V).

    Within a stretch the drive moves by ``most`` (V) at most.
    """

    drive: Array
    displacement: Array
    noise: float
    least: float
    most: float
    settings: FitSettings

    def split(self, first: int, last: int, length: int) -> Iterator[int]:
        """Yield where stretches of a length begin, or of half of it where they are not smooth."""
        window = self.settings.smooth_window * length
        for start in range(first, last, window):
            end = min(start + window, last)
            if length == 1 or (end == start + window and self._holds(start, end, length)):
                yield from range(start, end, length)
            else:
                yield from self.split(start, end, length // 2)

    def _holds(self, start: int, end: int, length: int) -> bool:
        """Whether means foretell both signals, of all lengths, and also for some time before.

        A sine that is faster than a length does not show in means over it.
        """
        settings, half = self.settings, length // 2
        if np.ptp(self.drive[start:end].reshape(-1, length), axis=1).max() > self.most:
            return False
        before = half * min(2 * settings.smooth_age, start // half)
        near = slice(start - before, min(end + 4 * half, len(self.drive)))
        drive, displacement = self.drive[near], self.displacement[near]
        least = (settings.smooth_drive * np.std(drive)) ** 2 + self.least**2
        samples, white = 1, 0.5 + 0.5 * float(FORETOLD @ FORETOLD)
        while samples < length:
            moved, driven = (np.mean(_details(one) ** 2) for one in (displacement, drive))
            uncertain = settings.smooth_sigma * np.sqrt(4.0 / len(drive))
            if moved > (1.0 + uncertain) * white * self.noise**2 / samples or driven > least:
                return False
            drive, displacement = averaged(drive, 2), averaged(displacement, 2)
            samples *= 2
        return True


def _details(signal: Array) -> Array:
    """Half the difference of both halves of each pair, less what the means foretell of it."""
    pairs = signal[: len(signal) // 2 * 2].reshape(-1, 2)
    mean, half = pairs.mean(axis=1), 0.5 * (pairs[:, 0] - pairs[:, 1])
    return np.asarray(half[2:-2] - np.correlate(mean, FORETOLD, "valid"))


class _StretchBank(NamedTuple):
    """A bank by the length of a stretch, of which the complex poles, ``modes`` many, come first.

    The mean over a stretch holds the states before it, the mean of the input and its slope with the
    weights ``of_states``, ``of_input`` and ``of_slope``. After it the states have decayed by ``z``
    towards that mean, and a unit of slope has moved them by ``shifts``.
    """

    z: Complex
    of_states: Complex
    modes: int
    of_input: Array
    of_slope: Array
    shifts: Complex


class StretchFilter:
    """A bank of poles for columns known by their means over stretches, piece by piece.

    Within a stretch of n samples a column is the line of the slope between its neighbours,

        v_j = v + u_j s,    u_j = (j - (n - 1) / 2) / n,    S = Σ_j u_j z^(n - 1 - j),

    which adds (1 - z) S s to the state after the stretch, and -S s / n to the mean of the state.
    Before the first stretch each column had settled at its value in ``settled``.
    """

    def __init__(
        self,
        bank: tuple[Complex, Complex],
        direct: float,
        period: float,
        edges: Edges,
        settled: Array,
    ) -> None:
        some = np.flatnonzero(bank[1])
        order = some[np.argsort(bank[0][some].imag == 0.0, kind="stable")]
        poles, weights = (each[order] for each in bank)
        lengths, self._which = np.unique(np.diff(edges), return_inverse=True)
        samples = lengths[:, np.newaxis]
        mean = np.expm1(poles * period * samples) / (samples * np.expm1(poles * period))
        sums = np.array([_of_slope(np.exp(poles * period), length) for length in lengths])
        self._bank = _StretchBank(
            np.exp(poles * period * samples),
            mean * weights,
            int(np.count_nonzero(poles.imag)),
            direct + np.sum((1.0 - mean) * weights, axis=1).real,
            -np.sum(sums * weights, axis=1).real / lengths,
            -np.expm1(poles * period) * sums,
        )
        middles = np.pad(0.5 * (edges[1:] + edges[:-1]), 1, mode="edge")
        self._shares = np.diff(edges) / np.maximum(middles[2:] - middles[:-2], 1.0)
        self._first, self._before = 0, settled
        self._states = np.zeros((2, len(poles), len(settled)))
        self._states[0] = settled
        self._live = settled != 0.0

    def __call__(self, columns: Array, after: Array | None = None) -> Array:
        """Means of the output for the next piece, both (stretches, columns).

        ``after`` is the row that follows the piece, if any. A column that has been zero so far
        costs nothing.
        """
        before = self._before if self._first else columns[0]
        self._before = columns[-1]
        part = slice(self._first, self._first + len(columns))
        self._first = part.stop
        self._live |= columns.any(axis=0)
        if after is not None:
            self._live |= after != 0.0
        padded = np.vstack([before, columns, columns[-1] if after is None else after])
        given = self._which[part], self._shares[part], self._bank
        if self._live.all():
            return _filtered(padded, *given, *self._states)
        result, states = np.zeros(columns.shape), np.compress(self._live, self._states, axis=2)
        some = np.compress(self._live, padded, axis=1)
        result[:, self._live] = _filtered(some, *given, *states)
        self._states[:, :, self._live] = states
        return result

    def pulled(self, pull: Array) -> tuple[Array, Array]:
        """Derivatives of Σ_s pull_s y_s by the inputs of all stretches, and by the settled inputs.

        y_s is the mean of the output over stretch s; ``pull`` and the first result have the shape
        (stretches, n), the second (n,).
        """
        later = np.zeros((2, self._bank.z.shape[1], pull.shape[1]))
        result = _pulled(pull, self._which, self._shares, self._bank, *later)
        return result, later[0].sum(axis=0)


def _of_slope(z: Complex, samples: int) -> Complex:
    """S of poles z, (poles,), in a stretch of so many samples."""
    places = np.arange(samples)[:, np.newaxis]
    line = (places - 0.5 * (samples - 1)) / samples
    return np.asarray(np.sum(line * z ** (samples - 1 - places), axis=0))


@compiled
def _pulled(
    pull: Array, which: Edges, shares: Array, bank: _StretchBank, real: Array, imag: Array
) -> Array:
    """Transpose of ``_filtered``: from the last stretch back, with the states' own derivatives."""
    z, of_states, _, of_input, of_slope, shifts = bank
    stretches, many = pull.shape
    result, slope = np.zeros((stretches, many)), np.empty(many)
    for s in range(stretches - 1, -1, -1):
        kind = which[s]
        for c in range(many):
            result[s, c] += of_input[kind] * pull[s, c]
            slope[c] = of_slope[kind] * pull[s, c]
        for i in range(z.shape[1]):
            tr, ti = of_states[kind, i].real, of_states[kind, i].imag
            zr, zi = z[kind, i].real, z[kind, i].imag
            sr, si = shifts[kind, i].real, shifts[kind, i].imag
            for c in range(many):
                xr, xi = real[i, c], imag[i, c]
                result[s, c] += (1.0 - zr) * xr + zi * xi
                slope[c] += sr * xr - si * xi
                real[i, c] = zr * xr - zi * xi + tr * pull[s, c]
                imag[i, c] = zr * xi + zi * xr + ti * pull[s, c]
        for c in range(many):
            result[min(s + 1, stretches - 1), c] += shares[s] * slope[c]
            result[max(s - 1, 0), c] -= shares[s] * slope[c]
    return result


@compiled
def _filtered(
    padded: Array, which: Edges, shares: Array, bank: _StretchBank, real: Array, imag: Array
) -> Array:
    z, of_states, modes, of_input, of_slope, shifts = bank
    stretches, many = padded.shape[0] - 2, padded.shape[1]
    result, slope = np.empty((stretches, many)), np.empty(many)
    for b in range(stretches):
        kind = which[b]
        for c in range(many):
            slope[c] = shares[b] * (padded[b + 2, c] - padded[b, c])
            result[b, c] = of_input[kind] * padded[b + 1, c] + of_slope[kind] * slope[c]
        for i in range(modes):
            tr, ti = of_states[kind, i].real, of_states[kind, i].imag
            zr, zi = z[kind, i].real, z[kind, i].imag
            sr, si = shifts[kind, i].real, shifts[kind, i].imag
            for c in range(many):
                v = padded[b + 1, c]
                xr, xi = real[i, c], imag[i, c]
                result[b, c] += tr * xr - ti * xi
                xr -= v
                real[i, c] = v + zr * xr - zi * xi + sr * slope[c]
                imag[i, c] = zr * xi + zi * xr + si * slope[c]
        for i in range(modes, z.shape[1]):
            tr, zr, sr = of_states[kind, i].real, z[kind, i].real, shifts[kind, i].real
            for c in range(many):
                v, xr = padded[b + 1, c], real[i, c]
                result[b, c] += tr * xr
                real[i, c] = v + zr * (xr - v) + sr * slope[c]
    return result
