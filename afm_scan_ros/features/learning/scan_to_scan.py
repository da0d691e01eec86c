"""Iterative learning control of one axis: the next correction from all scans so far.

Law: each scan j states what the correction should have been, z_j = c_j + e_j / (T W), with W the
model behind its own inverse and T the scanner over the model. The next correction is the mean of
all z_j, weighted by their precision, shrunk where noise explains it (J. Inst. C. Stein, Ann. Stat.
9 (1981) 1135), and zero where convergence is not certain. D. A. Bristow, M. Tharayil and A. G.
Alleyne, IEEE Control Systems 26 (2006) 96, states the condition |1 - L T W| < 1.
"""

from collections.abc import Sequence

import numpy as np
from attrs import field, frozen
from numpy.typing import NDArray

from afm_scan_ros.core.comparison import RELEVANT_CHANGE
from afm_scan_ros.core.effects.vibration import held
from afm_scan_ros.core.metrics import METRES
from afm_scan_ros.core.model import AxisModel, InverseSettings
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.scanner import chain_of
from afm_scan_ros.core.types import Array
from afm_scan_ros.features.learning.resonance_shift import (
    LOCAL,
    ScanSpectra,
    Spectrum,
    band_edges,
    band_mean,
    local_mean,
)
from afm_scan_ros.features.learning.response import (
    MotionSpectra,
    RelativeResponse,
    estimated_response,
    relative_error,
)

UNCERTAIN = 0.05
"""Largest probability with which a frequency that is learned does not converge."""
SHRINKAGE = (LOCAL - 1.0) / LOCAL
"""Part of the variance that James and Stein's estimator takes off the mean power."""
LEAST_SHARE = 0.01
"""Share of a reference that the scanner follows, below which nothing is learned."""
CERTAIN = 3.0
"""Standard deviations by which an error must grow to count as grown."""


@frozen(eq=False)
class TrialSpectra:
    """Spectra of one axis of a scan: its correction, what was measured, and its error.

    The error is desired minus measured, with the share of a correction that is used. The correction
    has the frequencies that are learned, the others have all.
    """

    correction: Spectrum
    all_measured: Spectrum
    all_error: Spectrum

    @property
    def measured(self) -> Spectrum:
        """What was measured, at the frequencies that are learned."""
        return self.all_measured[: len(self.correction)]

    @property
    def error(self) -> Spectrum:
        """Error at the frequencies that are learned."""
        return self.all_error[: len(self.correction)]

    @property
    def power(self) -> float:
        """Power of the error at all frequencies."""
        return float(_power(self.all_error).sum())


@frozen
class Convergence:
    """The test of monotone convergence, before a correction is used.

    A frequency is learned where the factor on its error is below 1 with the probability
    1 - ``UNCERTAIN``. ``bound`` is the largest rms of the next error over the present one, by these
    factors and with the noise of another scan. ``learned`` is the share of the error's power at
    learned frequencies. ``noise`` is the rms of what does not repeat from scan to scan,
    ``learned_noise`` of its part in the correction.
    """

    bound: float
    learned: float
    noise: float = field(metadata=METRES)
    learned_noise: float = field(metadata=METRES)


@frozen(eq=False)
class LearningStep:
    """The spectrum of the next correction, m, at ``frequencies`` (Hz).

    ``length`` is that of the transform in samples. ``effort`` is the drive that each part of it
    takes, relative to what the same displacement takes at rest, squared. ``response`` is the one by
    which it was learned.
    """

    frequencies: Array
    length: int
    correction: Spectrum
    effort: Array
    response: RelativeResponse
    convergence: Convergence

    def with_less_drive(self, price: float) -> Spectrum:
        """Correction that minimises the error's power plus ``price`` times the drive's."""
        return self.correction / (1.0 + price * self.effort)


class AxisLearning:
    """Learns one axis of a scan with the inverse of its model.

    ``frequencies`` (Hz) end where the model follows less than ``LEAST_SHARE`` of its reference.
    """

    def __init__(self, spec: ScanSpec, axis: AxisModel, desired: Array) -> None:
        self.spectra = ScanSpectra.of_scan(spec)
        gain, model = _responses(axis, self.spectra)
        self._count = 1 + int(np.flatnonzero(np.abs(model) >= LEAST_SHARE)[-1])
        self._gain, self._model = (self._used(each) for each in (gain, model))
        self.frequencies = self.spectra.frequencies[: self._count]
        self._vibration = axis.vibration
        self._model_error = relative_error(axis.model_discrepancies, self.frequencies)
        self._desired = desired
        self._moved = self._model * self._used(self.spectra.of(desired))
        self._spacing = spec.line_rate / self.frequencies[1]

    def trial(self, reference: Array, measured: Array) -> TrialSpectra:
        """Spectra of a scan made with a reference, m."""
        spectra = self.spectra
        correction = self._used(spectra.of(reference - self._desired))
        error = spectra.of(spectra.share * (self._desired - measured))
        return TrialSpectra(correction, spectra.of(measured), error)

    def _used(self, spectrum: Spectrum) -> Spectrum:
        return spectrum[: self._count].copy()

    def step(
        self, trials: Sequence[TrialSpectra], held_back: NDArray[np.bool_], best: int
    ) -> LearningStep:
        """Return the next correction; the first two scans are those without one.

        At frequencies that are ``held_back`` it stays that of the ``best`` scan.
        """
        all_noise = _not_repeating(trials)
        noise = all_noise[: self._count]
        moved = [self._moved + self._model * each.correction for each in trials]
        motion = MotionSpectra(moved, [each.measured for each in trials], noise, self._spacing)
        response = estimated_response(self._vibration, self._model_error, self.frequencies, motion)
        needed, variance = self._needed(trials, response, noise)
        uncertainty = np.sqrt(-np.log(UNCERTAIN) * response.relative_variance)
        learned = (uncertainty < 1.0) & ~held_back
        power = np.maximum(local_mean(np.abs(needed) ** 2), np.finfo(float).tiny)
        share = np.where(learned, np.maximum(0.0, 1.0 - SHRINKAGE * variance / power), 0.0)
        factor = np.where(learned, 1.0 - share + share * uncertainty, 1.0)
        carried = np.abs(response.ratio * self._model) ** 2 * share**2 * variance
        error, whole = _power(trials[-1].error), trials[-1].power
        following = whole - ((1.0 - factor**2) * error).sum() + all_noise.sum()
        convergence = Convergence(
            float(np.sqrt(following / whole)),
            float(error[learned].sum() / whole),
            self.spectra.rms(all_noise),
            self.spectra.rms(carried),
        )
        effort = np.abs(self._gain[0] / (response.ratio * self._gain)) ** 2
        kept = np.where(held_back, trials[best].correction, 0.0)
        correction = np.where(learned, share * needed, kept)
        return LearningStep(
            self.frequencies, self.spectra.length, correction, effort, response, convergence
        )

    def grown(self, trials: Sequence[TrialSpectra], best: int) -> NDArray[np.bool_]:
        """Frequencies of the bands in which the last scan's error is larger than the best's.

        Larger beyond what does not repeat, and by a relevant part of the whole error's power.
        """
        noise = _not_repeating(trials)[: self._count]
        last, least = (_power(trials[k].error) for k in (-1, best))
        edges = band_edges(len(last))
        change, spread = (
            np.add.reduceat(each, edges[:-1])
            for each in (last - least, 2.0 * noise * (last + least))
        )
        relevant = RELEVANT_CHANGE * trials[best].power
        return np.repeat(change > np.maximum(CERTAIN * np.sqrt(spread), relevant), np.diff(edges))

    def _needed(
        self, trials: Sequence[TrialSpectra], response: RelativeResponse, noise: Array
    ) -> tuple[Spectrum, Array]:
        """What the correction should be, and its variance, by all scans together.

        A Kalman filter of a value that may move: what a scan shows beyond the variance of the
        prediction and its own adds to the first.
        """
        whole = response.ratio * self._model
        size = np.maximum(np.abs(whole) ** 2, np.finfo(float).tiny)
        found, variance = np.zeros(len(noise), complex), np.full(len(noise), np.inf)
        for each in trials:
            shown = each.correction + each.error / whole
            unsure = response.relative_variance * local_mean(np.abs(each.error) ** 2)
            own = (noise + unsure) / size
            if np.isinf(variance[0]):
                found, variance = shown, own
                continue
            excess = local_mean(np.abs(shown - found) ** 2) - variance - own
            variance = variance + np.maximum(excess, 0.0)
            gain = variance / (variance + own)
            found = found + gain * (shown - found)
            variance = (1.0 - gain) * variance
        return found, variance


def _not_repeating(trials: Sequence[TrialSpectra]) -> Array:
    """Power of what differs between the first two scans, which had one drive.

    It is at least what rounding can make of the largest amplitude.
    """
    first, second = (each.all_measured for each in trials[:2])
    least = np.finfo(float).eps * float(_power(first).max())
    return np.maximum(0.5 * band_mean(_power(second - first)), least)


def _power(spectrum: Spectrum) -> Array:
    return np.asarray(spectrum.real**2 + spectrum.imag**2)


def _responses(axis: AxisModel, spectra: ScanSpectra) -> tuple[Spectrum, Spectrum]:
    """Response of the model's vibration, m/V, and that of its inverse and itself in series."""
    model = chain_of(axis)
    kernel = model.vibration(spectra.period, InverseSettings()).inverse.kernel
    taps = np.zeros(spectra.length)
    places = (np.arange(len(kernel.values)) - kernel.centre) % spectra.length
    np.add.at(taps, places, kernel.values)
    omega = np.minimum(2.0 * np.pi * spectra.frequencies, np.pi / spectra.period)
    gain = held(model.model.vibration, spectra.period).response(omega)
    return gain, np.fft.rfft(taps) * gain
