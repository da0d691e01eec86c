"""A swept sine, chirped or stepped → the frequency response along the way.

The whole record is transformed at once, from rest to rest: so nothing leaks. Over a few
neighbouring bins the response is smooth, a polynomial fitted by least squares (after the local
polynomial method of R. Pintelon and J. Schoukens, System Identification, 2nd ed., Wiley 2012,
chapter 7). What it leaves of the bins is noise and nonlinearity.
"""

import numpy as np
from scipy.ndimage import uniform_filter1d
from scipy.signal import hilbert

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.vibration.line_response import FrequencyResponse
from afm_scan_ros.core.identification.vibration.spectra import Complex
from afm_scan_ros.core.types import Array

BINS = 17
"""Neighbouring bins that make one line of the response."""
DEGREE = 2
"""Of the polynomial over them."""
EXCITED = 0.03
"""Bins that the sweep drives less than this share of the strongest are left out."""
SINGLE = 0.1
"""Share of its frequency by which a sweep's envelope changes, at most."""
DISTORTION = 0.005
"""Third harmonic over fundamental beyond which a sweep shows hysteresis more than vibration."""
RAYLEIGH = 4.0 / (15.0 * np.pi)
"""That ratio for each unit that the gain rises above the one at rest (Lord Rayleigh, 1887)."""
CYCLES = 10
"""Cycles of the sweep over which harmonics are compared."""
NINTH = 1.0 / 9.0
"""Harmonics are compared below this share of the band: the third still lies low in it."""
REST = 0.2
"""Seconds that the drive rests at either end, for the vibration to die."""


def is_sweep(drive: Array) -> bool:
    """Whether a drive, (n,), is a single sine at a time, its envelope slow beside it."""
    analytic = hilbert(drive - drive.mean())
    envelope = np.abs(analytic)
    turning = np.abs(np.diff(analytic))
    return bool(np.abs(np.diff(envelope)).sum() < SINGLE * turning.sum())


def swept_response(
    drive: Array, effective: Array, output: Array, sample_period: float
) -> FrequencyResponse:
    """Response of ``output`` to ``effective``, all (n,), where the sweep ``drive`` passes.

    One sweep cannot tell noise from nonlinearity: ``noise`` and ``scatter`` are the same. Raises
    InputError where hysteresis that ``effective`` does not hold distorts the sweep.
    """
    _refuse_unrest(drive, sample_period)
    given, got = _transform(effective), _transform(output)
    first, count = _driven(_transform(drive))
    bins = slice(first, first + count * BINS)
    windows = given[bins].reshape(count, BINS), got[bins].reshape(count, BINS)
    response, deviation, coherence, left = _local(*windows)
    unexplained = np.zeros_like(got)
    unexplained[bins] = left.ravel()
    _refuse_distortion(drive, output, np.fft.irfft(unexplained, len(drive)), bins.stop)
    centre = first + BINS // 2 + BINS * np.arange(count)
    omega = np.asarray(centre * (2.0 * np.pi / (len(drive) * sample_period)), dtype=np.float64)
    found = FrequencyResponse(omega, response, deviation, deviation, coherence)
    strength = np.sqrt(np.mean(np.abs(windows[0]) ** 2, axis=1))
    return found.at(strength > EXCITED * strength.max())


def _refuse_unrest(drive: Array, sample_period: float) -> None:
    rest = int(np.ceil(REST / sample_period))
    for where, stretch in (("beginning", drive[:rest]), ("end", drive[-rest:])):
        if np.ptp(stretch) > 0.0:
            raise InputError(
                f"frequency record: the sweep does not rest at its {where}; hold the drive for"
                f" {REST:g} s before and after it"
            )


def _transform(signal: Array) -> Complex:
    """Transform from rest to rest: by way of the differences, which are 0 at both ends."""
    differences = np.fft.rfft(np.diff(signal, prepend=signal[0]))
    turn = np.exp(-2j * np.pi * np.arange(len(differences)) / len(signal))
    differences[1:] /= 1.0 - turn[1:]
    differences[0] = 0.0
    return np.asarray(differences)


def _driven(drive: Complex) -> tuple[int, int]:
    """First bin of the band that the sweep drives, and how many windows the band holds."""
    strength = uniform_filter1d(np.abs(drive), BINS)
    strong = np.flatnonzero(strength > EXCITED * strength[BINS:].max())
    first = max(int(strong[0]), 1)
    return first, (int(strong[-1]) + 1 - first) // BINS


def _local(given: Complex, got: Complex) -> tuple[Complex, Array, Array, Complex]:
    """Response, its deviation and coherence, (windows,), and what is left, (windows, BINS)."""
    along = np.linspace(-1.0, 1.0, BINS)[:, np.newaxis] ** np.arange(DEGREE + 1)
    columns = given[:, :, np.newaxis] * along
    solution = np.linalg.pinv(columns)
    found = solution @ got[:, :, np.newaxis]
    left = got - (columns @ found)[:, :, 0]
    variance = np.sum(np.abs(left) ** 2, axis=1) / (BINS - DEGREE - 1)
    deviation = np.sqrt(variance * np.sum(np.abs(solution[:, 0]) ** 2, axis=1))
    coherence = 1.0 - variance / np.mean(np.abs(got) ** 2, axis=1)
    return found[:, 0, 0], deviation, np.maximum(coherence, 0.0), left


def _refuse_distortion(drive: Array, output: Array, left: Array, highest: int) -> None:
    """Compare the third harmonic of what is left, (n,), with the output's fundamental.

    ``highest`` is the number of cycles in the record of the band's last bin.
    """
    phase = np.unwrap(np.angle(hilbert(drive - drive.mean())))
    starts = np.flatnonzero(np.diff(phase // (2.0 * np.pi * CYCLES), prepend=0.0) > 0.0)
    slow = np.diff(starts) > CYCLES * len(drive) / (NINTH * highest)
    third, fundamental = (
        np.abs(np.add.reduceat(signal * np.exp(-1j * harmonic * phase), starts))[:-1][slow]
        for signal, harmonic in ((left, 3), (output, 1))
    )
    share = float(np.median(third / fundamental)) if slow.any() else 0.0
    if share > DISTORTION:
        raise InputError(
            f"frequency record: hysteresis in the sweep: its third harmonic is {share:.1%} of the"
            f" fundamental, so the gain is some {share / RAYLEIGH:.0%} above that at small"
            " amplitude; sweep with less amplitude, or record periodic multisines"
        )
