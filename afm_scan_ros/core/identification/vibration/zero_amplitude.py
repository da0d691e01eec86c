"""Weaker and weaker waves → the response to the drive itself at zero amplitude.

Of small oscillations Rayleigh's law (1887) holds: the gain of a rate-independent hysteresis rises
in proportion to the amplitude, and so does what it distorts. A straight line through the
responses, line by line, therefore ends at zero amplitude in the response of a scanner without
hysteresis, found without a model of it: a check on the response to F = H(u).
"""

import numpy as np

from afm_scan_ros.core.identification.vibration.line_response import FrequencyResponse
from afm_scan_ros.core.identification.vibration.periodic import is_periodic, record_spectra
from afm_scan_ros.core.identification.vibration.spectra import RecordSpectra, response_matrix
from afm_scan_ros.core.identification.vibration.swept import is_sweep
from afm_scan_ros.core.types import Array

LEVELS = 2


def response_at_zero_amplitude(
    drive: Array, output: Array, sample_period: float
) -> FrequencyResponse | None:
    """Response of ``output`` (m) to ``drive`` (V), both (n,), as the amplitude vanishes.

    The strongest waves are left out where two weaker levels remain. None where the record has one
    amplitude only, or is not periodic.
    """
    if is_sweep(drive) or not is_periodic(drive[:, np.newaxis]):
        return None
    columns = drive[:, np.newaxis], drive[:, np.newaxis], output[:, np.newaxis]
    levels = record_spectra(*columns, sample_period).levels()
    if len(levels) < LEVELS:
        return None
    return _extrapolate(levels if len(levels) == LEVELS else levels[1:])


def _extrapolate(levels: list[RecordSpectra]) -> FrequencyResponse:
    """Straight line over amplitude, (levels,), at each line; what it misses is scatter."""
    amplitudes = np.array([level.amplitudes.mean() for level in levels])
    found = [FrequencyResponse.between(response_matrix(level), 0, 0) for level in levels]
    responses = np.array([response.response for response in found])
    line = np.column_stack([np.ones(len(levels)), amplitudes])
    solution = np.linalg.pinv(line)
    ends = solution @ responses
    noises = np.array([response.noise for response in found])
    noise = np.sqrt(solution[0] ** 2 @ noises**2)
    missed = np.sum(np.abs(responses - line @ ends) ** 2, axis=0)
    spare = max(len(levels) - 2, 1)
    scatter = np.sqrt(np.sum(solution[0] ** 2) * missed / spare)
    coherence = np.array([response.coherence for response in found]).min(axis=0)
    return FrequencyResponse(found[0].omega, ends[0], noise, np.maximum(noise, scatter), coherence)
