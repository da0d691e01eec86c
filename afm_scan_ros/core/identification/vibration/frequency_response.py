"""A record of any drive that reaches beyond the resonance → the frequency response.

Zero amplitude: of small oscillations Rayleigh's law (1887) holds: the gain of a rate-independent
hysteresis rises in proportion to the amplitude, and so does what it distorts. A straight line
through the responses, line by line, therefore ends at zero amplitude in the response of a scanner
without hysteresis, found without a model of it: a check on the response to F = H(u).

The input is the hysteresis' output F = H(u), not the drive u: the hysteresis' own gain and lag
would otherwise be taken for the vibration's.
"""

import numpy as np
from attrs import evolve
from scipy.signal import hilbert

from afm_scan_ros.core.identification.vibration.line_response import (
    FrequencyResponse,
    LocalResponse,
    local_response,
)
from afm_scan_ros.core.identification.vibration.spectra import (
    RecordSpectra,
    is_periodic,
    record_spectra,
    refuse_out_of_step,
    response_matrix,
)
from afm_scan_ros.core.types import Array

SINGLE = 0.1
"""Share of its frequency by which a sweep's envelope changes, at most."""
BESIDE = (2.5, 3.5)
"""Multiples of the frequency at which hysteresis has no harmonic: the rest of the residual."""
CYCLES = 10
"""Cycles of the sweep over which harmonics are compared."""
NINTH = 1.0 / 9.0
"""Harmonics are compared below this share of the band: the third still lies low in it."""


def is_sweep(drive: Array) -> bool:
    """Whether a drive, (n,), is a single sine at a time, its envelope slow beside it."""
    analytic = hilbert(drive - drive.mean())
    envelope = np.abs(analytic)
    turning = np.abs(np.diff(analytic))
    return bool(np.abs(np.diff(envelope)).sum() < SINGLE * turning.sum())


def distortion(drive: Array, output: Array, found: LocalResponse) -> float:
    """Third harmonic of the residual of a sweep, over the output's fundamental.

    ``drive`` (V) and ``output`` are those of ``found``, (n,). It is hysteresis that the input does
    not hold.
    """
    phase = np.unwrap(np.angle(hilbert(drive - drive.mean())))
    starts = np.flatnonzero(np.diff(phase // (2.0 * np.pi * CYCLES), prepend=0.0) > 0.0)
    slow = np.diff(starts) > CYCLES * len(drive) / (NINTH * found.cycles)
    third, below, above, fundamental = (
        np.abs(np.add.reduceat(signal * np.exp(-1j * harmonic * phase), starts))[:-1][slow]
        for signal, harmonic in (
            (found.residual, 3),
            *((found.residual, h) for h in BESIDE),
            (output, 1),
        )
    )
    beyond = np.maximum(third**2 - np.maximum(below, above) ** 2, 0.0) ** 0.5
    return float(np.median(beyond / fundamental)) if slow.any() else 0.0


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


def frequency_response(
    drive: Array, effective: Array, output: Array, sample_period: float
) -> FrequencyResponse:
    """Response of ``output`` to ``effective``, all of shape (n,), where ``drive`` shows it.

    Of a periodic drive a period counts when it equals the period before, so that it is steady, and
    of several amplitudes the largest. Sweeps, noise and steps are taken whole. Raises InputError
    of a drive that nearly repeats.
    """
    swept = is_sweep(drive)
    if not swept and is_periodic(drive[:, np.newaxis]):
        drives, inputs, outputs = (s[:, np.newaxis] for s in (drive, effective, output))
        strongest = record_spectra(drives, inputs, outputs, sample_period).levels()[0]
        steady = FrequencyResponse.between(response_matrix(strongest), output=0, given=0)
        return steady if len(strongest.inputs) > 1 else steady.with_distortion()
    if not swept:
        refuse_out_of_step(drive[:, np.newaxis])
    found = local_response(drive, effective, output, sample_period)
    if not swept:
        return found.response
    return evolve(found.response, distortion=distortion(drive, output, found))
