"""Spectral lines of a residual that neither the sensor's noise nor a transient explains.

The periodogram of noise has an exponential distribution. Its mean at a line is told by the median
of m independent neighbours, since noise and what leaks of the model's error are smooth over a few
lines: as well as by the mean of k = m ln² 2 of them. A value exceeds k ((n / p)^(1/k) - 1) times
that mean with the probability p / n, and one of n values with p. A tone lasts, so it has its share
in both halves of the record; what decays after a move has not.
"""

import numpy as np
import scipy

from afm_scan_ros.core.diagnosis.repetition import Repetition
from afm_scan_ros.core.diagnosis.settings import PARTING, PartingSettings
from afm_scan_ros.core.types import Array


def lasting_lines(
    residual: Array,
    sample_period: float,
    of: Repetition | None,
    settings: PartingSettings = PARTING,
) -> tuple[float, ...]:
    """Frequencies (Hz) of the lines of a residual (n,) that last, the clearest first.

    Where a motion repeats, the residual is what is between its harmonics, ``of`` these samples.
    """
    count = len(residual)
    halves = [np.fft.rfft(part, 2 * count) for part in np.array_split(residual, 2)]
    frequencies = np.arange(count + 1, dtype=np.float64) / (2.0 * count * sample_period)
    halves[1] *= np.exp(-2j * np.pi * frequencies * sample_period * -(-count // 2))
    periods = frequencies * count * sample_period
    kept = of.clear(periods, settings.clear) if of else periods > settings.clear
    power = np.where(kept, np.abs(halves[0] + halves[1]) ** 2, 0.0)
    least = np.full(len(power), np.inf)
    least[kept] = _beyond_chance(power[kept], settings)
    lasts = np.minimum(*np.abs(halves)) ** 2 >= settings.lasting**2 * power
    loud = (power > least) & lasts
    peaks = loud[1:-1] & (power[1:-1] > power[:-2]) & (power[1:-1] >= power[2:])
    found = 1 + np.flatnonzero(peaks)
    return tuple(frequencies[found[np.argsort(-power[found] / least[found])]].tolist())


def without_tones(
    residual: Array,
    sample_period: float,
    of: Repetition | None,
    settings: PartingSettings = PARTING,
) -> Array:
    """Residual (n,) without its lines that last, one after the other.

    Of a tone only what is between the harmonics is in a residual that is.
    """
    left = residual
    for _ in range(settings.tones):
        found = lasting_lines(left, sample_period, of, settings)
        if not found:
            break
        tone = _tone(left, sample_period, found[0])
        left = left - (of.part_between(tone) if of else tone)
    return left


def _beyond_chance(power: Array, settings: PartingSettings) -> Array:
    """Least power (n,) of a line that chance hardly makes, of a periodogram (n,).

    Of a record padded to twice its length, three values tell a median as well as two independent
    ones. Towards the ends the neighbourhood becomes smaller.
    """
    count, half = len(power), settings.neighbourhood // 2
    reach = np.minimum(half, np.minimum(np.arange(count), np.arange(count)[::-1]))
    median = scipy.ndimage.median_filter(power, settings.neighbourhood, mode="nearest")
    for i in np.flatnonzero(reach < half):
        median[i] = np.median(power[i - reach[i] : i + reach[i] + 1])
    known = 2.0 / 3.0 * (2 * reach + 1) * np.log(2.0) ** 2
    with np.errstate(over="ignore"):
        ratio = known * np.expm1(np.log(max(count, 1) / settings.false_alarm) / known)
    return np.asarray(ratio * median / np.log(2.0))


def _tone(residual: Array, sample_period: float, frequency: float) -> Array:
    """Tone (n,) near a frequency that explains most of a residual (n,)."""
    time = sample_period * np.arange(len(residual))

    def fitted(at: float) -> Array:
        wave = np.exp(2j * np.pi * at * time)
        return np.asarray((2.0 / len(time) * (residual @ wave.conj()) * wave).real)

    near = 0.5 / (len(time) * sample_period)
    found = scipy.optimize.minimize_scalar(
        lambda at: float(np.sum((residual - fitted(at)) ** 2)),
        bounds=(frequency - near, frequency + near),
        method="bounded",
        options={"xatol": 1e-3 * near},
    )
    return fitted(float(found.x))
