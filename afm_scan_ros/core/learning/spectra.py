"""Spectra of a scan's signals, and averages over neighbouring frequencies."""

from typing import TypeVar

import numpy as np
from attrs import frozen
from numpy.typing import NDArray
from scipy import fft

from afm_scan_ros.core.learning.correction import window
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
