"""Variance of the residual in the cells of a record, and from how many amplitudes it is known.

Sensor noise and model discrepancy differ in their number of independent amplitudes. The discrepancy
has few, wherever it lies, and so has a cell in which the model moves. Between the harmonics of a
motion, and at rest, noise has as many as there are coefficients. The number of amplitudes of both
together is Satterthwaite's (Biometrics Bull. 2, 1946, 110): with variances a and b of m and n
amplitudes it is (a + b)² / (a²/m + b²/n).

Between the harmonics the record itself tells the noise: by the median of the squared coefficients,
once tones are taken out. What exceeds it there is the part of the discrepancy that does not repeat,
or repeats with fast changes.
"""

import math
from itertools import pairwise

import numpy as np
import scipy
from attrs import frozen
from scipy.fft import dct
from scipy.stats import chi2, f

from afm_scan_ros.core.diagnosis.cells import RecordCells
from afm_scan_ros.core.diagnosis.discrepancy import SMALLEST, DetectionLimit
from afm_scan_ros.core.diagnosis.settings import PARTING, VARIANCE
from afm_scan_ros.core.diagnosis.tones import without_tones
from afm_scan_ros.core.types import Array


def satterthwaite(one: Array, other: Array, of_one: Array | float, of_other: float) -> Array:
    """Amplitudes of the sum of two variances, each of so many amplitudes."""
    return np.asarray((one + other) ** 2 / (one**2 / of_one + other**2 / of_other))


@frozen(eq=False)
class CellVariance:
    """Variance (cells,) of a residual in m², of which ``noise`` (cells,) is the sensor's.

    ``freedom`` (cells,) are its independent amplitudes, ``known`` (cells,) those it is known from.
    """

    total: Array
    noise: Array
    freedom: Array
    known: Array

    @classmethod
    def of_motion(cls, limit: DetectionLimit, tested: float) -> "CellVariance":
        """Return that of a record that moves, by band; the discrepancy is known as ``tested``."""
        noise, error = _parts(limit)
        few = np.ones_like(noise)
        return cls(noise + error, noise, VARIANCE.freedom * few, tested * few)

    @classmethod
    def of_noise(cls, noise: Array, error: Array, counts: Array, tested: float) -> "CellVariance":
        """Return that of noise of so many amplitudes, and an error (cells,) of few, both in m²."""
        freedom = satterthwaite(noise, error, counts, VARIANCE.freedom)
        known = satterthwaite(noise, error, VARIANCE.known, tested)
        return cls(noise + error, noise, freedom, known)

    @classmethod
    def at_rest(
        cls, limit: DetectionLimit, cells: RecordCells, moved: Array, tested: float
    ) -> "CellVariance":
        """Return that of a record of little motion (n,), as whose error all of it counts."""
        noise, error = _parts(limit)
        most = np.maximum(error, cells.power(cells.coefficients(moved)))
        return cls.of_noise(noise, most, cells.counts, tested)

    @classmethod
    def repeating(
        cls, limit: DetectionLimit, cells: RecordCells, moved: Array, residual: Array, tested: float
    ) -> "CellVariance":
        """Return that of a record whose motion repeats, of its predicted motion and residual (n,).

        Between the harmonics lies as much of the discrepancy as of the motion, and at least what is
        seen there of a residual without its tones, up to what the discrepancy of a band hardly ever
        exceeds: the rest is no error of the model.
        """
        noise, error = _parts(limit)
        along, between = cells.power(cells.coefficients(moved)).reshape(2, cells.bands)
        shares = between / (along + between + SMALLEST**2)
        counts = cells.counts.reshape(2, cells.bands)
        of_motion, of_rest = counts / counts.sum(axis=0) * noise
        power, seen = between_power(cells, residual, of_rest)
        most = error * f.isf(PARTING.false_alarm, VARIANCE.freedom, tested)
        beyond = np.clip(power - seen, shares * error, most)
        rest = cls.of_noise(seen, beyond, counts[1], tested)
        few = np.ones(cells.bands)
        return cls(
            np.append(of_motion + (1.0 - shares) * error, rest.total),
            np.append(of_motion, rest.noise),
            np.append(VARIANCE.freedom * few, rest.freedom),
            np.append(tested * few, rest.known),
        )

    @property
    def expected_weights(self) -> Array:
        """Weights (cells,) of a residual as expected, in 1/m²."""
        return self.weights(self.total)

    def weights(self, power: Array) -> Array:
        """Minus twice the slope (cells,) of the log density over the ``power``, in 1/m²."""
        return weights(power, self.total, self.known, self.freedom)


def _parts(limit: DetectionLimit) -> tuple[Array, Array]:
    """Variance (bands,) of noise and of discrepancy, m²."""
    error = VARIANCE.typical_share * np.maximum(limit.rms**2 - limit.noise**2, 0.0)
    return np.maximum(limit.noise, SMALLEST) ** 2, np.asarray(error)


def log_density(power: Array, variance: Array, known: Array, freedom: Array) -> Array:
    """Log likelihood of cells of mean square ``power``, in m² as the ``variance``.

    The variance is ``known`` as from so many amplitudes, k. The power has those of ``freedom``, n.
    Constant terms are left out.
    """
    excess = np.log1p(freedom * power / (known * variance))
    return np.asarray(-0.5 * (freedom * np.log(variance) + (freedom + known) * excess))


def weights(power: Array, variance: Array, known: Array, freedom: Array) -> Array:
    """Minus twice the slope (cells,) of the log density over ``power``, in 1/m²."""
    return np.asarray(freedom * (freedom + known) / (known * variance + freedom * power))


def between_power(cells: RecordCells, residual: Array, noise: Array) -> tuple[Array, Array]:
    """Mean square (bands,) between the harmonics without its tones, and that of the noise alone.

    Noise is told by the median of the squared coefficients, as a few larger ones leave it alone,
    within a factor of the ``noise`` (bands,) of the calibration. The ends are tapered for it, to a
    mean square of one, lest the model's error at a resonance leaks into the bands beside.
    Source of the taper: F. J. Harris, Proc. IEEE 66 (1978) 51, equation 27.
    """
    if (of := cells.repetition) is None:
        raise ValueError("the motion does not repeat")
    seen = of.signal(of.between(residual[np.newaxis])[0])
    left = without_tones(seen, cells.sample_period, of)
    taper = math.sqrt(8.0 / 3.0) * scipy.signal.windows.hann(len(left), sym=False)
    squares, tapered = (dct(x, norm="ortho") ** 2 / cells.count for x in (left, left * taper))
    clear = of.clear(np.arange(of.count, dtype=np.float64) / 2.0)
    bands = [slice(*each) for each in pairwise(cells.firsts[1])]
    kept = [tapered[band][clear[band]] for band in bands]
    medians = [np.median(few) / chi2.median(1) if len(few) else 0.0 for few in kept]
    most = of.settings.other_noise**2
    floor = np.clip(cells.counts[cells.bands :] * medians, noise / most, noise * most)
    return np.array([squares[band].sum() for band in bands]), floor
