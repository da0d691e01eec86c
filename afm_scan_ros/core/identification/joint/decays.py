"""What moves near a frequency while the drive has nothing of it: free decays.

No density of a hysteresis turns as exactly as the ringing shows: 0.2 rad of its phase, a thirtieth
of a cycle, is 0.3 % of a frequency that is seen for ten cycles. So nothing is asked of the
hysteresis. After each turn a damped sine begins from an amplitude and a phase of its own; frequency
and damping are common to all.
"""

from collections.abc import Iterator, Sequence

import numpy as np
from attrs import frozen
from numpy.typing import NDArray
from scipy.stats import f as fisher

from afm_scan_ros.core.identification.joint.moving import MovingRecord
from afm_scan_ros.core.identification.joint.search import LEVEL
from afm_scan_ros.core.identification.vibration.local_response import transform
from afm_scan_ros.core.identification.vibration.spectra import Complex
from afm_scan_ros.core.types import Array

SEVERAL = 3
"""Records, or decays of one, from which on their disagreement gives the error."""
WIDTH = 0.3
"""Standard deviation of the logarithm of the frequencies that are near another."""
QUIET = 0.01
"""Share of a drive's largest motion near a frequency below which it has none."""
CYCLES = 4
"""Cycles for which a decay is seen at least."""


@frozen(eq=False)
class Decays:
    """Stretches of displacement near a frequency in which the drive has nothing of it.

    ``moved`` are over the rms of all, ``record`` counts the record that each comes from, and
    ``freedom`` the independent numbers in all: twice bandwidth times time.
    """

    moved: Sequence[Array]
    sample_periods: Sequence[float]
    record: Sequence[int]
    freedom: float

    @classmethod
    def near(cls, frequency: float, records: Sequence[MovingRecord]) -> "Decays | None":
        """Cut records where their drives are quiet near a ``frequency`` (Hz).

        None where there are too few stretches to disagree.
        """
        found = [
            (stretch, record.sample_period, number)
            for number, record in enumerate(records)
            for stretch in _quiet(record, frequency * record.sample_period)
        ]
        if len(found) < SEVERAL:
            return None
        moved, periods, numbers = zip(*found, strict=True)
        size = np.linalg.norm(np.concatenate(moved))
        seconds = sum(len(each) * period for each, period in zip(moved, periods, strict=True))
        freedom = 2.0 * np.sqrt(np.pi) * WIDTH * frequency * seconds
        return cls([each / size for each in moved], periods, numbers, float(freedom))

    def residual(self, values: Array) -> Array:
        """The residual beside free decays of ``values`` ln ω and ln ζ, stretch after stretch."""
        omega, zeta = np.exp(values)
        pole = omega * (-zeta + 1j * np.sqrt(1.0 - zeta**2))
        residual = []
        for moved, period in zip(self.moved, self.sample_periods, strict=True):
            decay = np.exp(pole * period * np.arange(len(moved)))
            base = np.linalg.qr(np.column_stack([decay.real, decay.imag]))[0]
            residual.append(moved - base @ (base.T @ moved))
        return np.concatenate(residual)

    def strength(self, values: Array) -> float:
        """What decays explain over their residual, each over its degrees of freedom (F)."""
        taken = 2.0 * len(self.moved)
        residual = float(np.sum(self.residual(values) ** 2))
        return (1.0 - residual) / taken / (residual / (self.freedom - taken))

    def chance(self, tried: int) -> float:
        """Strength that noise exceeds at one of so many frequencies in 2.5 % of cases."""
        taken = 2.0 * len(self.moved)
        return float(fisher.isf((1.0 - LEVEL) / tried, taken, self.freedom - taken))

    def groupings(self) -> Iterator[Sequence[NDArray[np.int64]]]:
        """Yield rows by stretches, of which the noise differs, and by records, where several.

        What hysteresis adds to a decay recurs after every turn of a record. A few records may agree
        by chance, so neither grouping alone gives the error.
        """
        lengths = [len(each) for each in self.moved]
        yield _rows(np.repeat(np.arange(len(lengths)), lengths))
        if len(set(self.record)) >= SEVERAL:
            yield _rows(np.repeat(self.record, lengths))


def _rows(group: NDArray[np.int64]) -> Sequence[NDArray[np.int64]]:
    """Rows of each group, of the number of every row's, (n,)."""
    return [np.flatnonzero(group == each) for each in np.unique(group)]


def _quiet(record: MovingRecord, frequency: float) -> Iterator[Array]:
    """Displacement near a frequency (cycles a sample) while the drive has nothing of it."""
    moved = near(record.displacement, frequency).real
    driven = np.abs(near(record.drive, frequency))
    quiet = np.flatnonzero(driven < QUIET * driven.max())
    for stretch in np.split(quiet, np.flatnonzero(np.diff(quiet) > 1) + 1):
        if len(stretch) * frequency > CYCLES:
            yield moved[stretch]


def near(signal: Array, frequency: float, passed: Complex | float = 1.0) -> Complex:
    """Analytic signal, (n,), of what lies near a frequency (cycles a sample).

    ``passed`` is a response, (n // 2 + 1,), that the signal goes through first.
    """
    spectrum = passed * transform(signal)
    octaves = np.log(np.fft.rfftfreq(len(signal))[1:] / frequency)
    whole = np.zeros(len(signal), complex)
    whole[1 : len(spectrum)] = 2.0 * spectrum[1:] * np.exp(-0.5 * (octaves / WIDTH) ** 2)
    return np.asarray(np.fft.ifft(whole))
