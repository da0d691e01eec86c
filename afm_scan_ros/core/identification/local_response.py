"""The frequency response at the lines of a record, and by local fits to a drive of any shape.

A local fit transforms the whole record at once. Over a few neighbouring bins the response is
smooth, and so is what the record's ends leak: both are polynomials, fitted together by least
squares (the local polynomial method of R. Pintelon and J. Schoukens, System Identification, 2nd
ed., Wiley 2012, chapter 7). What they leave of the bins is noise and nonlinearity.
"""

from collections.abc import Iterator
from functools import cached_property

import numpy as np
from attrs import define, evolve, frozen
from numpy.typing import NDArray
from scipy.ndimage import binary_opening, median_filter, uniform_filter1d

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.vibration.spectra import Complex, LineResponses
from afm_scan_ros.core.types import Array

EDGE = 1e-9
"""Relative, for a band's own last line to lie within."""
NEIGHBOURS = 9
"""Lines over which the scatter is averaged, as few waves know it badly at each."""

LOCAL = 33
"""Lines over which distortion is taken from the fourth differences."""
FOURTH = np.array([1.0, -4.0, 6.0, -4.0, 1.0])
CHANCE = 3.0
"""-ln 0.05: of noise alone, |N|² over its mean exceeds this in 5 % of lines."""


@define(frozen=True, eq=False, slots=False)
class FrequencyResponse:
    """Response of the sampled system, shape (lines,): ``omega`` in rad/s, ``response`` complex.

    ``noise`` is the response's standard deviation from period to period (sensor), ``scatter``
    that from wave to wave (sensor and what the input model does not explain), both of the mean.
    ``coherence`` is the share of the output's power that the input explains, period by period.
    ``distortion`` is the third harmonic of a sweep that it does not, over the fundamental.
    """

    omega: Array
    response: Complex
    noise: Array
    scatter: Array
    coherence: Array
    distortion: float = 0.0

    @classmethod
    def between(cls, matrix: LineResponses, output: int, given: int) -> "FrequencyResponse":
        """One entry of a matrix of responses."""
        return cls(
            matrix.omega,
            matrix.response[:, output, given],
            matrix.noise[:, output, given],
            matrix.scatter[:, output, given],
            matrix.coherence[:, output],
        )

    @property
    def frequency(self) -> Array:
        """Lines in Hz."""
        return np.asarray(self.omega / (2.0 * np.pi))

    @property
    def nonlinearity(self) -> Array:
        """Standard deviation from wave to wave beyond that from period to period."""
        return np.asarray(np.sqrt(np.maximum(self.scatter**2 - self.noise**2, 0.0)))

    @cached_property
    def deviation(self) -> Array:
        """Expected size of the response's error: noise and nonlinearity of neighbouring lines.

        The noise hardly changes from line to line, the nonlinearity as the response does.
        """
        noise, size = self.noise**2, np.abs(self.response) ** 2
        beyond = smooth((self.scatter**2 - noise) / size)
        return np.asarray(np.sqrt(smooth(noise) + size * np.maximum(beyond, 0.0)))

    @property
    def noise_share(self) -> float:
        """Noise over response, rms over the lines."""
        return float(np.sqrt(np.mean((self.noise / np.abs(self.response)) ** 2)))

    @property
    def nonlinearity_share(self) -> float:
        """Scatter beyond the noise over response, rms over the lines."""
        beyond = np.mean((self.scatter**2 - self.noise**2) / np.abs(self.response) ** 2)
        return float(np.sqrt(max(beyond, 0.0)))

    def with_distortion(self) -> "FrequencyResponse":
        """The response of one wave, its scatter that from line to line.

        Distortion by one wave repeats from period to period, but is unlike at neighbouring lines,
        where the response is smooth (Pintelon and Schoukens, 2012, section 4.3). It is taken from
        the fourth differences, relative to the response. Their median over ``LOCAL`` lines leaves
        out a resonance too sharp for them; |N|² of noise has the median ln 2 times its mean.
        """
        if len(self.omega) < LOCAL:
            return self
        bend = np.convolve(self.response, FOURTH, "valid") / np.linalg.norm(FOURTH)
        relative = np.abs(bend / self.response[2:-2]) ** 2
        level = median_filter(np.pad(relative, 2, mode="edge"), LOCAL, mode="nearest") / np.log(2.0)
        return evolve(self, scatter=np.maximum(self.noise, np.sqrt(level) * np.abs(self.response)))

    def up_to(self, highest: float) -> "FrequencyResponse":
        """The lines up to ``highest`` Hz, but for rounding."""
        return self.at(self.omega <= 2.0 * np.pi * highest * (1.0 + EDGE))

    def seen(self) -> "FrequencyResponse":
        """The lines up to the last about which most stand out of the noise.

        A line stands out where chance alone would make it so large in one case of twenty. Raises
        InputError where none does.
        """
        stands_out = np.abs(self.response) ** 2 > CHANCE * self.deviation**2
        most = 2.0 * uniform_filter1d(stands_out.astype(np.float64), NEIGHBOURS) > 1.0
        if not most.any():
            raise InputError(
                "frequency record: no line of the response stands out of the noise; drive with"
                " more amplitude, or longer"
            )
        return self.at(np.arange(len(most)) <= np.flatnonzero(most)[-1])

    def advanced(self, delay: float) -> "FrequencyResponse":
        """The response as it were without a ``delay`` in s."""
        return evolve(self, response=self.response * np.exp(1j * self.omega * delay))

    def at(self, lines: NDArray[np.bool_]) -> "FrequencyResponse":
        """The lines chosen by a mask, shape (lines,)."""
        return evolve(
            self,
            omega=self.omega[lines],
            response=self.response[lines],
            noise=self.noise[lines],
            scatter=self.scatter[lines],
            coherence=self.coherence[lines],
        )


def smooth(variance: Array) -> Array:
    """Mean over neighbouring lines, (lines,)."""
    return np.asarray(uniform_filter1d(variance, NEIGHBOURS, mode="nearest"))


BINS = 17
"""Neighbouring bins that make one line of the response, at least."""
WIDTH = 1e-3
"""Share of its frequency that a line is wide, where that is more: a damping of 0.003 takes six."""
DEGREE = 2
"""Of the polynomials over them."""
EXCITED = 0.03
"""Lines that drive and moves are both below this share of their strongest at are left out."""
FEWEST = 5
"""Adjacent lines: fewer are of the way to a sweep and back, as large as no wave of it is."""


@frozen(eq=False)
class LocalResponse:
    """The response, its residual of the output, (n,); ``cycles`` is the last driven bin."""

    response: FrequencyResponse
    residual: Array
    cycles: int


def local_response(
    drive: Array, effective: Array, output: Array, sample_period: float
) -> LocalResponse:
    """Response of ``output`` to ``effective``, both (n,), where the drive (V), (n,), is strong.

    One record cannot separate noise from nonlinearity: ``noise`` and ``scatter`` are the same.
    """
    driven, given, got = (transform(signal) for signal in (drive, effective, output))
    moves = np.abs(driven) * np.abs(1.0 - _turn(len(drive)))
    strong = [_mean(size, len(drive)) for size in (np.abs(driven), moves)]
    lines = np.any([size > EXCITED * size.max() for size in strong], axis=0)
    lines = binary_opening(lines, np.ones(FEWEST))
    unexplained, found = np.zeros_like(got), []
    for bins in _windows(len(drive)):
        response, deviation, coherence, residual = _local(given[bins], got[bins])
        unexplained[bins] = residual
        centre = bins[:, bins.shape[1] // 2]
        found.append(np.array([centre, response, deviation, coherence]))
    centre, response, deviation, coherence = np.hstack(found)[:, lines]
    omega = centre.real * (2.0 * np.pi / (len(drive) * sample_period))
    frequency = FrequencyResponse(omega, response, deviation.real, deviation.real, coherence.real)
    return LocalResponse(
        frequency, np.fft.irfft(unexplained, len(drive)), int(centre.real[-1]) + BINS // 2
    )


def remainder(given: Complex, got: Complex) -> Complex:
    """What no local response to ``given`` explains of ``got``, transforms (bins,) of a record."""
    residual = np.zeros_like(got)
    for bins in _windows(2 * (len(got) - 1)):
        residual[bins] = _local(given[bins], got[bins])[3]
    return residual


def _windows(samples: int) -> Iterator[NDArray[np.int64]]:
    """Bins of the lines of an octave, (lines, bins), octave by octave."""
    first, last = 1, samples // 2 + 1
    while last - first >= BINS:
        width = max(BINS, 2 * int(0.5 * WIDTH * first) + 1)
        count = max(min(first, last - first) // width, 1)
        if first + width > last:
            return
        yield first + np.arange(count * width).reshape(count, width)
        first += count * width


def _mean(size: Array, samples: int) -> Array:
    """Rms of each line."""
    return np.concatenate([np.sqrt(np.mean(size[bins] ** 2, axis=1)) for bins in _windows(samples)])


def _turn(samples: int) -> Complex:
    """Delay by a sample, (bins,)."""
    return np.asarray(np.exp(-2j * np.pi * np.arange(samples // 2 + 1) / samples))


def transform(signal: Array) -> Complex:
    """Transform by way of the differences, so that the jump from end to start leaks nothing."""
    differences = np.fft.rfft(np.diff(signal, prepend=signal[0]))
    differences[1:] /= 1.0 - _turn(len(signal))[1:]
    differences[0] = 0.0
    return np.asarray(differences)


def _local(given: Complex, got: Complex) -> tuple[Complex, Array, Array, Complex]:
    """Response, its deviation and coherence, (lines,), and the residual, (lines, bins)."""
    columns = polynomials_of(given)
    solution = np.linalg.pinv(columns)
    found = solution @ got[:, :, np.newaxis]
    residual = got - (columns @ found)[:, :, 0]
    variance = np.sum(np.abs(residual) ** 2, axis=1) / (columns.shape[1] - columns.shape[2])
    deviation = np.sqrt(variance * np.sum(np.abs(solution[:, 0]) ** 2, axis=1))
    coherence = 1.0 - variance / np.mean(np.abs(got) ** 2, axis=1)
    return found[:, 0, 0], deviation, np.maximum(coherence, 0.0), residual


def polynomials_of(given: Complex) -> Complex:
    """Columns (lines, bins, 2 DEGREE + 2): an input (lines, bins) and 1, each by powers."""
    along = np.linspace(-1.0, 1.0, given.shape[1])[:, np.newaxis] ** np.arange(DEGREE + 1)
    size = np.sqrt(np.mean(np.abs(given) ** 2, axis=1))[:, np.newaxis, np.newaxis]
    leak = np.where(size > 0.0, size, 1.0) * along
    return np.concatenate([given[:, :, np.newaxis] * along, leak], axis=2)
