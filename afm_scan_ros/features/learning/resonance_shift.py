"""Spectra of a scan, and the shift of gain and of the first resonance that its error shows."""

from typing import TypeVar

import numpy as np
from attrs import frozen
from numpy.typing import NDArray
from scipy import fft
from scipy.optimize import least_squares

from afm_scan_ros.core.correction import window
from afm_scan_ros.core.effects.parameter_shift import GAIN, RESONANCE
from afm_scan_ros.core.effects.vibration import VibrationModel, first_resonance
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.trajectory import phases
from afm_scan_ros.core.types import Array

Spectrum = NDArray[np.complex128]

NEIGHBOURS = 2
"""Frequencies to each side over which a response counts as constant."""
LOCAL = 2 * NEIGHBOURS + 1
PADDING = 8
"""The transition from a signal's end to its beginning takes this part of its length."""
WIDTH, LEAST = 0.25, 8
"""Width of a band over its lower edge, and the fewest frequencies in a band."""


@frozen(eq=False)
class ScanSpectra:
    """Transforms signals of one scan, from its approach on; the preparation is left out.

    ``period`` is the sample period (s), ``first`` the approach's first sample, ``length`` that of
    the transform in samples, ``share`` the part of a correction that is used at each sample,
    ``tail`` what leads a signal from one back to zero after its end.
    """

    period: float
    first: int
    length: int
    share: Array
    tail: Array

    @classmethod
    def of_scan(cls, spec: ScanSpec) -> "ScanSpectra":
        """Return the transform of a scan's signals."""
        where = phases(spec)
        count = where.total - where.approach.start
        length = fft.next_fast_len(count + count // PADDING, real=True)
        after = length - count
        tail = 0.5 * (1.0 + np.cos(np.pi * np.arange(1, after + 1) / after))
        return cls(spec.sample_period, where.approach.start, length, window(spec), tail)

    @property
    def frequencies(self) -> Array:
        """Frequencies, Hz."""
        return np.asarray(fft.rfftfreq(self.length, self.period))

    def of(self, signal: Array) -> Spectrum:
        """Spectrum of a signal of the whole scan, led smoothly back from its end to zero."""
        led_back = np.concatenate([signal[self.first :], signal[-1] * self.tail])
        return np.asarray(fft.rfft(led_back))

    def correction(self, spectrum: Spectrum) -> Array:
        """Signal of the whole scan with a spectrum, faded to zero at both ends of the lines.

        Frequencies that the spectrum lacks at its end are not in the signal.
        """
        count = len(self.share) - self.first
        result = np.zeros(len(self.share))
        signal = fft.irfft(spectrum, self.length)[:count]
        np.multiply(signal, self.share[self.first :], out=result[self.first :])
        return result

    def rms(self, power: Array) -> float:
        """Rms of a signal of the record's length with |spectrum|² ``power``, over the record."""
        total = float(2.0 * power.sum() - power[0])
        return float(np.sqrt(total / (self.length * (len(self.share) - self.first))))


Values = TypeVar("Values", Array, Spectrum)


def local_mean(values: Values) -> Values:
    """Mean over each frequency and its neighbours."""
    padded = np.pad(values, NEIGHBOURS, mode="reflect")
    total = sum(padded[k : k + len(values)] for k in range(LOCAL))
    return np.asarray(total / LOCAL)


def band_mean(power: Array, least: int = LEAST) -> Array:
    """Mean over the band that each frequency lies in, of ``least`` frequencies or more."""
    edges = band_edges(len(power), least)
    widths = np.diff(edges)
    return np.repeat(np.add.reduceat(power, edges[:-1]) / widths, widths)


def band_edges(count: int, least: int = LEAST) -> NDArray[np.int64]:
    """First frequency of each band and, at last, the number of frequencies."""
    edges = [0]
    while edges[-1] + least <= count:
        edges.append(edges[-1] + max(least, int(WIDTH * edges[-1])))
    edges = edges[:-1] if len(edges) > 2 else edges[:1]  # noqa: PLR2004 - the last band is wider
    return np.array([*edges, count])


AROUND = 0.5, 2.0
"""Frequencies over the first resonance in which a shift of it shows."""
FINEST = 8
"""Groups of frequencies within the width of the model's resonance, where there are so many."""
LEAST_HARMONICS = 8
"""Harmonics around the resonance from which on the error's spectrum shows it."""
EULER, LOG_SPREAD = float(np.euler_gamma), float(np.pi / np.sqrt(6.0))
"""Minus the mean, and the standard deviation, of the logarithm of an exponential variable."""


@frozen(eq=False)
class Shift:
    """What multiplies the model's response where gain and first resonance have moved.

    ``values`` are the logarithms of the factors on gain, frequency and damping.
    """

    resonance: float
    damping: float
    values: Array
    covariance: Array

    def ratio(self, frequencies: Array) -> Spectrum:
        """Response over that of the model."""
        return _shifted(self.resonance, self.damping, self.values, frequencies)

    def variance(self, frequencies: Array) -> Array:
        """Relative variance of the ratio, to first order."""
        _, frequency, damped = np.exp(self.values)
        relative = frequencies / (frequency * self.resonance)
        damping = damped * self.damping
        decay = 2j * damping * relative
        after = _resonant(relative, damping)
        by_frequency, by_damping = (decay - 2.0 * relative**2) / after, -decay / after
        slopes = np.array([np.ones_like(after), by_frequency, by_damping])
        return np.asarray((slopes.conj() * (self.covariance @ slopes)).sum(axis=0).real)


def _shifted(resonance: float, damping: float, values: Array, frequencies: Array) -> Spectrum:
    gain, frequency, damped = np.exp(values)
    before = _resonant(frequencies / resonance, damping)
    after = _resonant(frequencies / (frequency * resonance), damped * damping)
    return np.asarray(gain * before / after)


def _resonant(relative: Array, damping: float) -> Spectrum:
    return np.asarray(1.0 - relative**2 + 2j * damping * relative)


def fitted_shift(
    vibration: VibrationModel, frequencies: Array, error: "ModelError", spacing: float
) -> Shift | None:
    """Fit a shift to the error of a scan; None without a resonance.

    The error in phase with the model's motion shows a shift. So does the power of all other error,
    for its spectrum peaks at the scanner's own resonance (output-only modal analysis; R. Brincker
    and C. Ventura, Introduction to Operational Modal Analysis, Wiley 2015). Each factor's prior has
    the catalogue's bounds at two standard deviations.
    """
    try:
        found = first_resonance(vibration)
    except InputError:
        return None
    resonance, damping = found.omega / (2.0 * np.pi), found.damping
    lower, upper = AROUND
    used = slice(*np.searchsorted(frequencies, (lower * resonance, upper * resonance)))
    width = 2.0 * damping * resonance / frequencies[1]
    size = max(1, int(min(width / FINEST, spacing)))
    near, part = _grouped(frequencies[used], size), _Shown.of(error.at(used), size)
    ringing = _ringing(vibration, near, resonance, part, spacing / size)
    start = np.zeros(3) if ringing is None else np.append(np.zeros(3), ringing.start)
    bounds = np.log([[p.lower, p.upper] for p in (*GAIN, *RESONANCE)]).T
    spread = (bounds[1] - bounds[0]) / 4.0
    weight = np.sqrt(part.precision)

    def residual(values: Array) -> Array:
        shifted = _shifted(resonance, damping, values[:3], near) - 1.0
        left = weight * (part.ratio - shifted)
        parts = [left.real, left.imag, values[:3] / spread]
        if ringing is not None:
            parts.append(ringing.residual(shifted, values[3:]))
        return np.concatenate(parts)

    free = np.full(len(start) - 3, np.inf)
    limits = np.append(bounds[0], -free), np.append(bounds[1], free)
    best = least_squares(residual, start, bounds=limits, loss="soft_l1")
    covariance = np.linalg.inv(best.jac.T @ best.jac)[:3, :3]
    return Shift(resonance, damping, best.x[:3], covariance)


@frozen(eq=False)
class ModelError:
    """Spectra of a scan: what the model ``moved``, and its ``error``.

    ``other`` is the power of what is not in proportion to the motion, ``noise`` of what does not
    repeat; all (n,).
    """

    moved: Spectrum
    error: Spectrum
    other: Array
    noise: Array

    def at(self, used: slice) -> "ModelError":
        """Return a part of the frequencies."""
        return ModelError(self.moved[used], self.error[used], self.other[used], self.noise[used])


@frozen(eq=False)
class _Shown:
    """What groups of frequencies show: a ``ratio`` of error to motion, with its ``precision``.

    ``motion``, ``power`` and ``noise`` are the mean powers of motion, error and noise.
    """

    ratio: Spectrum
    precision: Array
    motion: Array
    power: Array
    noise: Array

    @classmethod
    def of(cls, error: ModelError, size: int) -> "_Shown":
        """Take groups of ``size`` frequencies: the sums that least squares of a ratio needs."""
        motion, power = (np.abs(each) ** 2 for each in (error.moved, error.error))
        product = _grouped(error.moved.conj() * error.error / error.other, size)
        weight = np.maximum(_grouped(motion / error.other, size), np.finfo(float).tiny)
        noise = _grouped(error.noise, size)
        return cls(
            product / weight, size * weight, _grouped(motion, size), _grouped(power, size), noise
        )


def _grouped(values: Values, size: int) -> Values:
    """Mean over each ``size`` values; what is left over at the end is left out."""
    return np.asarray(values[: len(values) // size * size].reshape(-1, size).mean(axis=1))


@frozen(eq=False)
class _Ringing:
    """The error's power at each harmonic of the line rate, as the scanner's response shapes it.

    Behind the response it is a power law of the frequency, whose two unknowns are fitted too.
    Harmonics are groups of frequencies, each of a ``width`` from its ``first`` one on.
    """

    first: NDArray[np.int64]
    width: NDArray[np.int64]
    gain: Array
    part: _Shown
    slope: Array

    @property
    def error(self) -> Array:
        """The error's mean power around each harmonic."""
        return self._mean(self.part.power)

    @property
    def start(self) -> Array:
        """First values of the unknowns."""
        return np.array([np.log(self.error.mean() / self.gain.mean()), 0.0])

    def residual(self, shifted: Spectrum, law: Array) -> Array:
        """Logarithm of the power over that expected, in standard deviations of one harmonic's."""
        excited = np.exp(law[0] + law[1] * self.slope) * self.gain * np.abs(1.0 + shifted) ** 2
        moved = np.abs(shifted) ** 2 * self.part.motion
        expected = self._mean(excited + moved + self.part.noise)
        return np.asarray((np.log(self.error / expected) + EULER) / LOG_SPREAD)

    def _mean(self, power: Array) -> Array:
        return np.asarray(np.add.reduceat(power, self.first) / self.width)


def _ringing(
    vibration: VibrationModel, frequencies: Array, resonance: float, part: _Shown, spacing: float
) -> _Ringing | None:
    """Return what the harmonics show; None of fewer than ``LEAST_HARMONICS``."""
    count = int(len(frequencies) / max(spacing, 1.0))
    if count < LEAST_HARMONICS:
        return None
    edges = np.linspace(0, len(frequencies), count + 1).astype(np.int64)
    gain = np.abs(vibration.response(2.0 * np.pi * frequencies) / vibration.static_gain) ** 2
    return _Ringing(edges[:-1], np.diff(edges), gain, part, np.log(frequencies / resonance))
