"""How the scanner's response differs from its model's, by frequency, with its uncertainty.

The ratio T = scanner / model is 1 where the model is right. What is known of it is combined by its
precision: the model's discrepancy, a shift of gain and first resonance, the scan's own motion, and
changes from scan to scan. The last are free of errors that repeat.
"""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from attrs import frozen

from afm_scan_ros.core.effects.scale import resonance_of
from afm_scan_ros.core.effects.vibration import VibrationModel
from afm_scan_ros.core.model import VIBRATING, ModelDiscrepancy
from afm_scan_ros.core.types import Array
from afm_scan_ros.features.learning.resonance_shift import (
    LOCAL,
    ModelError,
    Spectrum,
    band_mean,
    fitted_shift,
    local_mean,
)

LINE_RATES = 3
"""Width, in line rates, of a band that holds harmonics with and without motion."""
WEAKEST = 1e-6
"""Power over the band's mean below which a frequency is not driven."""
UNKNOWN = 1.0
"""Relative error of a model where nothing is known of it."""


@frozen(eq=False)
class RelativeResponse:
    """Ratio of the scanner's response to the model's, and its variance, both (n,)."""

    ratio: Spectrum
    variance: Array

    @property
    def relative_variance(self) -> Array:
        """Variance over the squared ratio."""
        return np.asarray(self.variance / np.abs(self.ratio) ** 2)


def relative_error(known: Sequence[ModelDiscrepancy], frequencies: Array) -> Array:
    """Error of a model over its displacement at frequencies (Hz): the least that is known."""
    result = np.full(len(frequencies), UNKNOWN)
    for each in known:
        rms, noise, moved = (np.array(v) for v in (each.rms, each.noise, each.displacement))
        share = np.hypot(rms, noise) / np.maximum(moved, np.finfo(float).tiny)
        band = np.searchsorted(each.bands, frequencies, side="right") - 1
        inside = (band >= 0) & (band < len(share))
        result[inside] = np.minimum(result[inside], share[band[inside]])
    return result


@frozen(eq=False)
class MotionSpectra:
    """Spectra of scans: ``moved`` by the model, ``measured``, each a list of one a scan.

    ``noise`` (n,) is the power of what does not repeat. ``spacing`` is the number of frequencies
    from one line rate to the next.
    """

    moved: Sequence[Spectrum]
    measured: Sequence[Spectrum]
    noise: Array
    spacing: float


def estimated_response(
    vibration: VibrationModel,
    model_error: Array,
    frequencies: Array,
    motion: MotionSpectra,
) -> RelativeResponse:
    """Return the ratio from the scans; the first two are those of the same drive.

    ``model_error`` (n,) is the ``relative_error`` that is known.
    """
    moved = motion.moved[0]
    measured = 0.5 * (motion.measured[0] + motion.measured[1])
    other = _not_driven(moved, measured - moved, motion.spacing) + 0.5 * motion.noise
    error = ModelError(moved, measured - moved, other, 0.5 * motion.noise)
    shift = fitted_shift(vibration, frequencies, error, motion.spacing)
    base = np.ones(len(frequencies), complex) if shift is None else shift.ratio(frequencies)
    variance = model_error**2
    if shift is not None:
        variance = variance + shift.variance(frequencies)
    moves = [base * each for each in motion.moved]
    own = _regressed(moves[0], measured, other)
    slow = int(
        np.searchsorted(frequencies, VIBRATING * resonance_of(vibration, 0.5 / frequencies[-1]))
    )
    own = _as_ratio(own, moves[0], measured, motion.spacing, slow)
    variance = np.maximum(variance, _excess(own, variance))
    changes = [
        _regressed(after - before, then - earlier, 2.0 * motion.noise)
        for (before, earlier), (after, then) in pairwise(zip(moves, motion.measured, strict=True))
    ]
    return _combined(base, variance, [own, *changes])


Regression = tuple[Spectrum, Array]
"""Sum of moved* measured, and of |moved|², each over its noise."""


def _regressed(moved: Spectrum, measured: Spectrum, noise: Array) -> Regression:
    weight = LOCAL / np.maximum(local_mean(noise), np.finfo(float).tiny)
    return weight * local_mean(moved.conj() * measured), weight * local_mean(np.abs(moved) ** 2)


def _as_ratio(
    own: Regression, moved: Spectrum, measured: Spectrum, spacing: float, slow: int
) -> Regression:
    """Weigh what the motion shows by the probability that the error is a ratio to the motion.

    Error that repeats may be a disturbance instead. From the frequency ``slow`` on, where modes
    that a model lacks may dominate, it counts as a ratio. Below it, the probability is the
    coherence of error and motion over some harmonics.
    """
    product, precision = own
    least = max(1, round(LINE_RATES * spacing))
    error = measured - moved
    powers = band_mean(np.abs(moved) ** 2, least) * band_mean(np.abs(error) ** 2, least)
    cross = moved.conj() * error
    common = band_mean(cross.real, least) ** 2 + band_mean(cross.imag, least) ** 2
    coherence = np.minimum(common / np.maximum(powers, np.finfo(float).tiny), 1.0)
    coherence[slow:] = 1.0
    excess = product / np.maximum(precision, np.finfo(float).tiny) - 1.0
    spread = coherence * (1.0 - coherence) * np.abs(excess) ** 2
    weighed = precision / (1.0 + precision * spread)
    return weighed * (1.0 + coherence * excess), weighed


def _combined(base: Spectrum, variance: Array, found: Sequence[Regression]) -> RelativeResponse:
    """Weigh all by their precision, around the shifted model."""
    sums = 1.0 / variance + sum(precision for _, precision in found)
    ratio = (1.0 / variance + sum(product for product, _ in found)) / sums
    return RelativeResponse(base * ratio, np.abs(base) ** 2 / sums)


def _not_driven(moved: Spectrum, error: Spectrum, spacing: float) -> Array:
    """Power of the error where the scan does not move: of hysteresis, and all that is no ratio."""
    least = max(1, round(LINE_RATES * spacing))
    power = np.abs(moved) ** 2
    weight = 1.0 / (power + WEAKEST * band_mean(power) + np.finfo(float).tiny)
    return band_mean(np.abs(error) ** 2 * weight, least) / band_mean(weight, least)


def _excess(own: Regression, variance: Array) -> Array:
    """Variance of the ratio in each band, as the driven frequencies show it (method of moments)."""
    product, precision = own
    driven = precision > UNKNOWN
    scatter = np.divide(1.0, precision, out=np.full(len(precision), UNKNOWN), where=driven)
    ratio = np.divide(product, precision, out=np.ones_like(product), where=driven)
    weight = 1.0 / (scatter + variance)
    return band_mean((np.abs(ratio - 1.0) ** 2 - scatter) * weight) / band_mean(weight)
