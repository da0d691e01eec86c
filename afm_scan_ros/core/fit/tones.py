"""Sines in the residual of a record that neither its drive nor a mode explains, as mains hum.

A sine is one line of the residual's spectrum. Of noise alone, the power of one of n bins over the
mean about it exceeds ln(n / chance) with the probability ``chance``.
"""

from collections.abc import Iterable, Iterator

import numpy as np
from attrs import evolve
from numpy.typing import NDArray
from scipy.ndimage import median_filter
from scipy.signal import find_peaks

from afm_scan_ros.core.fit.estimator import AxisFit
from afm_scan_ros.core.fit.settings import FitSettings
from afm_scan_ros.core.fit.stretches import averaged
from afm_scan_ros.core.types import Array


def free_tones(fit: AxisFit) -> bool:
    """Let sines in the residuals be free in their records; return whether there are more.

    They are sought anew each time, as one may have been what the model lacked. A record too short
    to show a sine is tried for those of the others, and for mains.
    """
    settings, before = fit.layout.settings, sum(len(one.tones) for one in fit.records)
    lefts = list(_with_tones(fit))
    triples = zip(fit.records, lefts, fit.motions(), strict=True)
    for k, (record, left, motion) in enumerate(triples):
        drive = averaged(record.drive, record.block)[record.used]
        found = find_tones(left, drive, motion, record.length, settings)
        fit.records[k] = evolve(record, tones=()).with_tones(found, settings.tone_most)
    known = {tone for record in fit.records for tone in record.tones}
    known |= {settings.slower_mains, settings.faster_mains}
    for k, left in enumerate(lefts):
        record = fit.records[k]
        lasts = record.length * len(record.mean)
        hidden = [tone for tone in known if 1.0 < tone * lasts < settings.tone_cycles]
        found = offered_tones(left, record.seconds, hidden, fit.variance(record), settings)
        fit.records[k] = record.with_tones(found, settings.tone_most)
    fit.weigh()
    return sum(len(one.tones) for one in fit.records) > before


def _with_tones(fit: AxisFit) -> Iterator[Array]:
    """Yield what the model leaves of each record, its tones included, m."""
    lefts = fit.left_of(fit.theta, gathered=False)
    for k, (record, (left, without)) in enumerate(zip(fit.records, lefts, strict=True)):
        free, first = fit.free_of(k, gathered=False), -4 * len(record.tones)
        tones = free.columns[:, first:] @ free.weights(left)[first:] if first else 0.0
        yield without + tones


def tone_amplitudes(fit: AxisFit) -> Iterator[tuple[tuple[float, float], ...]]:
    """Yield frequency (Hz) and amplitude (m), in the middle of each record, of its tones."""
    lefts = fit.left_of(fit.theta, gathered=False)
    for k, (record, (left, _)) in enumerate(zip(fit.records, lefts, strict=True)):
        free = fit.free_of(k, gathered=False)
        weights = free.weights(left)[len(free.columns.T) - 4 * len(record.tones) :]
        sizes = record.motion * np.hypot(weights[0::4], weights[1::4])
        yield tuple(zip(record.tones, map(float, sizes), strict=True))


def find_tones(
    residual: Array, drive: Array, motion: Array, period: float, settings: FitSettings
) -> list[float]:
    """Frequencies (Hz) of the sines in a residual (m), the strongest first.

    The ``drive`` is in V, the model's ``motion`` in m, all (n,). A line of the motion that is
    stronger than the residual's is left to the model, whose error it may be. So is a line of what a
    hysteresis makes of the motion, where an error as large as the residual explains it, and a line
    of the drive that leaves little more over the drive than its neighbours: there the model may
    lack a mode.
    """
    found, left = list[float](), residual - residual.mean()
    window, limit = np.hanning(len(left)), np.log(len(left) / settings.tone_chance)
    owned = _owned(left, drive, motion, window, settings)
    while len(found) < settings.tone_most:
        power = _power(left, window)
        ratio = np.where(power < owned, 0.0, _over_mean(power))
        ratio[: int(settings.tone_cycles)] = 0.0
        high = [one for one in find_peaks(power)[0] if ratio[one] > limit]
        peaks = [one for one in high if _narrow(power, one, settings)]
        if not peaks:
            break
        line = max(peaks, key=lambda peak: float(ratio[peak]))
        frequency = _finest(left, window, line)
        turn = 2.0 * np.pi * frequency * np.arange(len(left))
        pair = np.column_stack([np.cos(turn), np.sin(turn)])
        left = left - pair @ np.linalg.lstsq(pair, left, rcond=None)[0]
        found.append(frequency / period)
    return found


def offered_tones(
    residual: Array,
    seconds: Array,
    tones: Iterable[float],
    variance: float,
    settings: FitSettings,
) -> list[float]:
    """Those of some frequencies (Hz) that a residual (m) of a ``variance`` (m²) has, best first.

    A record too short to show a sine among its neighbours may still hold one that is known.
    """
    left, found, others = residual - residual.mean(), [], list(tones)
    while others:
        turns = 2.0 * np.pi * np.outer(others, seconds)
        pairs = np.stack([np.cos(turns), np.sin(turns)], axis=2)
        pairs -= pairs.mean(axis=1, keepdims=True)
        fitted = [pair @ np.linalg.lstsq(pair, left, rcond=None)[0] for pair in pairs]
        best = max(range(len(others)), key=lambda k: float(left @ fitted[k]))
        if 0.5 * float(left @ fitted[best]) / variance < settings.mode_chance:
            break
        left = left - fitted[best]
        found.append(others.pop(best))
    return found


def _owned(left: Array, drive: Array, motion: Array, window: Array, settings: FitSettings) -> Array:
    """Power in each bin that is the model's: see ``find_tones``."""
    limit, moved = np.log(len(left) / settings.tone_chance), motion - motion.mean()
    error = float(np.std(left) / max(np.std(motion), np.finfo(float).tiny))
    moving, driven = _power(moved, window), _power(drive - drive.mean(), window)
    owned = np.where(_lines(moving, limit, settings), moving, 0.0)
    owned = np.maximum(owned, _shared(driven, _power(left, window), limit, settings))
    for one in _distorted(moved):
        bent = settings.tone_loud * error**2 * _power(one, window)
        owned = np.maximum(owned, np.where(_lines(bent, limit, settings), bent, 0.0))
    return owned


def _shared(driven: Array, power: Array, limit: float, settings: FitSettings) -> Array:
    """Power at lines of the drive that as large a share of it at a neighbouring line explains."""
    result = np.zeros(len(power))
    peaks, _ = find_peaks(np.where(_over_mean(driven) > limit, driven, 0.0))
    shares = power[peaks] / driven[peaks]
    for k, peak in enumerate(peaks):
        beside = np.delete(shares[max(k - 1, 0) : k + 2], min(k, 1))
        near = slice(max(peak - settings.tone_side, 0), peak + settings.tone_side + 1)
        result[near] = settings.tone_loud * driven[near] * beside.max(initial=0.0)
    return result


def _distorted(motion: Array) -> Iterator[Array]:
    """Yield what a hysteresis adds to a motion, with the motion's own rms: its turns and bends."""
    way = np.sign(np.gradient(motion))
    for one in (motion**2, way, way * motion, way * motion**2):
        size = float(np.std(one))
        if size > 0.0:
            yield (one - one.mean()) * (np.std(motion) / size)


def _power(signal: Array, window: Array) -> Array:
    return np.abs(np.fft.rfft(window * signal)) ** 2


def _lines(power: Array, limit: float, settings: FitSettings) -> NDArray[np.bool_]:
    """Bins that belong to a line of a signal."""
    result = np.zeros(len(power), bool)
    peaks, _ = find_peaks(np.where(_over_mean(power) > limit, power, 0.0))
    for peak in peaks:
        near = slice(max(peak - settings.tone_side, 0), peak + settings.tone_side + 1)
        result[near] |= power[near] > settings.tone_fallen * power[peak]
    return result


def _over_mean(power: Array) -> Array:
    """Power over the mean of the hundred bins about it; the median of noise is ln 2 of its mean."""
    mean = median_filter(power, 101, mode="nearest") / np.log(2.0)
    return np.asarray(power / np.maximum(mean, np.finfo(float).eps * power.max() + 1e-300))


def _narrow(power: Array, line: int, settings: FitSettings) -> bool:
    """Whether a line has fallen by 13 dB where Hann's window has by 30."""
    side = settings.tone_side
    before = power[max(line - 2 * side, 1) : max(line - side + 1, 1)]
    sides = np.concatenate([before, power[line + side : line + 2 * side + 1]])
    return bool(settings.tone_fallen * power[line] > sides.max(initial=0.0))


def _finest(signal: Array, window: Array, line: int) -> float:
    """Cycles a sample of the sine about a bin, to a fortieth of a bin."""
    n = len(signal)
    tried = line + np.linspace(-1.0, 1.0, 81)
    waves = np.exp(-2j * np.pi * np.outer(tried / n, np.arange(n)))
    return float(tried[np.argmax(np.abs(waves @ (window * signal)))] / n)
