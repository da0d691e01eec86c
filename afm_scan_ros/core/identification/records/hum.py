"""Hum in a record: sines that go on throughout, whatever the drive does.

Of a periodic drive, what differs from period to period is looked at, bin by bin of a period's
transform: a sine turns there by the same angle from each period to the next. Of any other drive, a
linear response to it is taken off, a few bins of the whole record's transform at a time. A sine is
hum where an F test finds it among all bins with a chance of 1 %, and where it takes most of the
remainder about it: noise, drift and a mode that rings are not one sine. In step with a periodic
drive hum cannot be distinguished from the response, and is not looked for. Nor can a sine of less
than a turn be distinguished from a response that settles: the smaller residual decides.
"""

import numpy as np
from attrs import frozen
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from afm_scan_ros.core.effects.residual_features import STANDS_OUT
from afm_scan_ros.core.identification.vibration.line_response import (
    polynomials_of,
    remainder,
    transform,
)
from afm_scan_ros.core.identification.vibration.spectra import Complex, repetition, steady_runs
from afm_scan_ros.core.types import Array

CHANCE = 0.01
"""Probability that noise alone passes for hum anywhere in the record."""
NARROW = 0.25
"""Share of the power about a line that a sine may leave."""
ABOUT = 16
"""Bins on either side of a line that are looked at."""
MOST = 24
"""Lines sought."""
LOOKED = 200
"""Bins looked at, those first that stand out most."""
BLOCK = 101
"""Bins over which the median is taken."""
CYCLES = 20
"""Cycles in the record below which a sine is not distinguished from drift."""
PARTS, HELD = 4, 0.5
"""Parts of the record, and the share of the whole's amplitude that each holds at least."""
APART = 0.5
"""Share of a sine that the drive, where it does not repeat, could not have made, at least."""
FINER = 4
"""Angles tried from period to period, for each that the record resolves."""
SIDE = 2
"""Bins on either side that determine a sine's frequency."""
HIGHER = 4.0
"""Power over that in the bins so far aside: a sine has 9 times it, drift as much."""
LEAST = 0.03
"""Share of a sine that differs from period to period, below which it is in step with the drive."""


@frozen
class HumLine:
    """A sine of ``frequency`` (Hz): cosine and sine in m, of the time since the first sample."""

    frequency: float
    cosine: float
    sine: float

    @property
    def amplitude(self) -> float:
        """Its size, m."""
        return float(np.hypot(self.cosine, self.sine))

    def course(self, samples: int, sample_period: float) -> Array:
        """Displacement (m), (samples,)."""
        turn = 2.0 * np.pi * self.frequency * sample_period * np.arange(samples)
        return np.asarray(self.cosine * np.cos(turn) + self.sine * np.sin(turn))


def hum(drive: Array, displacement: Array, sample_period: float) -> tuple[HumLine, ...]:
    """Find the hum in a displacement (m) under a drive (V), both (n,), the largest line first."""
    columns = drive[:, np.newaxis]
    runs = steady_runs(columns) if np.ptp(drive) > 0.0 else []
    find = _Periods(repetition(columns), runs) if runs else _Bins(transform(drive))
    residual, found = displacement.copy(), list[HumLine]()
    while len(found) < MOST:
        detected = find.sine(residual)
        if detected is None:
            break
        turn, amplitude = detected
        line = HumLine(turn / sample_period, amplitude.real, -amplitude.imag)
        residual -= line.course(len(drive), sample_period)
        found.append(line)
    return tuple(sorted(found, key=lambda line: -line.amplitude))


def without_hum(
    drive: Array, displacement: Array, sample_period: float
) -> tuple[Array, tuple[HumLine, ...]]:
    """Return the displacement (m), (n,), without the hum in it, and that hum."""
    found = hum(drive, displacement, sample_period)
    quiet = displacement.copy()
    for line in found:
        quiet -= line.course(len(drive), sample_period)
    return quiet, found


@frozen(eq=False)
class _Periods:
    """Where a periodic drive of so many samples a period is steady, run by run."""

    period: int
    runs: list[NDArray[np.int64]]

    def sine(self, signal: Array) -> tuple[float, complex] | None:
        """Cycles a sample and amplitude of the sine that stands out most, if any does."""
        count = len(signal) // self.period
        lines = np.fft.rfft(signal[: count * self.period].reshape(count, -1), axis=1)[:, 1:-1]
        residual, which = self._beside(lines), np.concatenate(self.runs)
        spare = len(which) - len(self.runs) - 1
        offs = np.arange(-0.5, 0.5, 1.0 / (FINER * (which[-1] + 1)))
        waves = self._beside(np.exp(2j * np.pi * np.outer(np.arange(count), offs)))
        waves = waves[:, np.linalg.norm(waves, axis=0) > LEAST * np.sqrt(len(which))]
        whole = np.sum(np.abs(residual) ** 2, axis=0)
        waves /= np.linalg.norm(waves, axis=0)
        share = (np.abs(waves.conj().T @ residual) ** 2).max(axis=0) / whole
        tried = residual.size / (len(self.runs) + 1.0)
        beside = np.pad(whole, SIDE)
        stands_out = whole > HIGHER * np.maximum(beside[: -2 * SIDE], beside[2 * SIDE :])
        rare = (1.0 - share) ** spare * tried < CHANCE
        detected = stands_out & rare & (share > np.maximum(1.0 - NARROW, _drifting(residual)))
        if not detected.any():
            return None
        line = int(np.argmax(np.where(detected, share * whole, 0.0)))
        return self._finest(line + 1, residual, count)

    def _finest(self, line: int, residual: Complex, count: int) -> tuple[float, complex]:
        """Cycles a sample and amplitude of the sine in a bin, by it and those beside it.

        Runs of few periods alone leave several angles open, which spread unlike over the bins.
        """
        bins = np.arange(max(line - SIDE, 1), min(line + SIDE, residual.shape[1]) + 1)
        target = residual[:, bins - 1]

        def wave(off: float) -> Complex:
            turns = self._beside(np.exp(2j * np.pi * off * np.arange(count)))
            return np.outer(turns, _dirichlet(off + line - bins, self.period))

        def taken(off: float) -> float:
            own = wave(off)
            return float(np.abs(np.vdot(own, target)) ** 2 / np.vdot(own, own).real)

        step = 1.0 / (FINER * count)
        start = max(np.arange(-0.5, 0.5, step) + 0.5 * step, key=taken)
        best = minimize_scalar(
            lambda off: -taken(off), bounds=(start - step, start + step), method="bounded"
        )
        own = wave(float(best.x))
        size = complex(np.vdot(own, target) / np.vdot(own, own))
        return (line + float(best.x)) / self.period, 2.0 * size

    def _beside(self, each: Complex) -> Complex:
        """What differs from the run's mean, of values of all periods (periods, ...)."""
        return np.concatenate([each[run] - each[run].mean(axis=0) for run in self.runs])


@frozen(eq=False)
class _Bins:
    """The transform of a drive that does not repeat."""

    given: Complex

    def sine(self, signal: Array) -> tuple[float, complex] | None:
        """Cycles a sample and amplitude of the sine that stands out most, if any does."""
        got = transform(signal)
        for middle in _prominent(remainder(self.given, got)).tolist():
            at, amplitude, detected = self._about(got, middle, len(signal))
            if detected:
                return at / len(signal), amplitude
        return None

    def _about(self, got: Complex, middle: int, count: int) -> tuple[float, complex, bool]:
        """Where between bins a sine is, its amplitude, and whether it differs from all else."""
        bins = np.arange(middle - ABOUT, middle + ABOUT + 1)
        columns = polynomials_of(self.given[bins][np.newaxis])[0]
        across = np.linalg.qr(columns)[0]
        target = got[bins] - across @ (across.conj().T @ got[bins])

        def shape(at: float) -> Complex:
            wave = _dirichlet(np.asarray(at - bins), count)
            return np.asarray(wave - across @ (across.conj().T @ wave))

        def missed(at: float) -> float:
            wave = shape(at)
            return -float(np.abs(np.vdot(wave, target)) ** 2 / np.vdot(wave, wave).real)

        best = minimize_scalar(missed, bounds=(middle - 1.0, middle + 1.0), method="bounded")
        whole = float(np.vdot(target, target).real)
        share, spare = -float(best.fun) / whole, len(bins) - columns.shape[1] - 1
        wave = shape(float(best.x))
        size = complex(np.vdot(wave, target) / np.vdot(wave, wave))
        rare = max(1.0 - share, 0.0) ** spare * len(got) < CHANCE
        whole_sine = _dirichlet(np.asarray(float(best.x) - bins), count)
        apart = np.vdot(wave, wave).real > APART * np.vdot(whole_sine, whole_sine).real
        detected = rare and share > 1.0 - NARROW and apart and _held(target, size * wave)
        return float(best.x), 2.0 * size, detected


def _drifting(residual: Complex) -> Array:
    """Share, (bins,), of what differs from period to period that a drift explains.

    Creep, or a hysteresis that settles, changes the size of a bin and not its angle, however large
    it is: the best of all angles leaves the least residual. It is slow, so that the next period
    differs less than of noise, by von Neumann's ratio; what alternates is no drift.
    """
    whole = np.sum(np.abs(residual) ** 2, axis=0)
    slow = np.sum(np.abs(np.diff(residual, axis=0)) ** 2, axis=0) < 2.0 * whole
    along = 0.5 + 0.5 * np.abs(np.sum(residual**2, axis=0)) / whole
    return np.where(slow, along, 0.0)


def _prominent(residual: Complex) -> NDArray[np.int64]:
    """Bins at which a remainder (bins,) stands out of those about it, the largest first."""
    size = np.abs(residual)
    blocks = size[: len(size) // BLOCK * BLOCK].reshape(-1, BLOCK)
    middle = BLOCK * (np.arange(len(blocks)) + 0.5)
    if not len(blocks):
        return np.empty(0, dtype=np.int64)
    usual = np.interp(np.arange(len(size)), middle, np.median(blocks, axis=1))
    inner, k = size[1:-1], np.arange(1, len(size) - 1)
    peaks = (inner > size[:-2]) & (inner >= size[2:]) & (inner > STANDS_OUT * usual[1:-1])
    found = k[peaks & (k > max(CYCLES, ABOUT)) & (k < len(size) - ABOUT)]
    return np.asarray(found[np.argsort(-size[found] / usual[found], kind="stable")][:LOOKED])


def _dirichlet(off: Array, count: int) -> Complex:
    """Transform of exp(2πi k t / n), n samples of ``count``, at bins that are ``off`` from it."""
    turn = 2j * np.pi * off / count
    near = np.abs(off) < 1e-9  # noqa: PLR2004 - rounding
    safe = np.where(near, 1.0, turn)
    return np.asarray(np.where(near, count, np.expm1(safe * count) / np.expm1(safe)))


def _held(residual: Complex, sine: Complex) -> bool:
    """Whether each part of the record holds a sine, of both the bins about it, as the whole does.

    Their inverse transform is the envelope, from the record's start to its end.
    """
    envelopes = (np.array_split(np.fft.ifft(signal), PARTS) for signal in (residual, sine))
    parts = zip(*envelopes, strict=True)
    return bool(min((np.vdot(own, all_) / np.vdot(own, own)).real for all_, own in parts) > HELD)
