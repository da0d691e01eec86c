"""A record of a periodic drive → the frequency response at the lines that the drive excites.

The input is the hysteresis' output F = H(u), not the drive u: the hysteresis' own gain and lag
would otherwise be taken for the vibration's.
"""

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import Array

EXCITED = 1e-3
"""Lines of the drive below this share of its strongest are not excited."""


@frozen(eq=False)
class FrequencyResponse:
    """Response of the sampled system, shape (lines,): ``omega`` in rad/s, ``response`` complex.

    ``noise`` is the response's standard deviation from period to period (sensor), ``scatter``
    that from wave to wave (sensor and what the input model does not explain), both of the mean.
    """

    omega: Array
    response: NDArray[np.complex128]
    noise: Array
    scatter: Array


def frequency_response(
    drive: Array, effective: Array, output: Array, sample_period: float
) -> FrequencyResponse:
    """Response of ``output`` to ``effective`` where ``drive`` repeats itself, all of shape (n,).

    A period counts when the drive equals the period before, so that it is steady. Raises
    InputError where no two periods in succession are.
    """
    period = repetition(drive)
    count = len(drive) // period
    drives, inputs, outputs = (
        signal[: count * period].reshape(count, period) for signal in (drive, effective, output)
    )
    steady = 1 + np.flatnonzero(np.all(drives[1:] == drives[:-1], axis=1))
    runs = np.split(steady, np.flatnonzero(np.diff(steady) > 1) + 1)
    runs = [run for run in runs if len(run) > 1]
    if not runs:
        raise InputError(
            f"frequency record: the drive, taken in {count} pieces of {period} samples, is never"
            " three times the same; drive a periodic multisine from the record's start"
        )
    lines = _excited(drives[steady])
    spectra = [(_lines(inputs[run], lines), _lines(outputs[run], lines)) for run in runs]
    omega = np.asarray(lines * (2.0 * np.pi / (period * sample_period)), dtype=np.float64)
    return _average(spectra, omega)


def repetition(drive: Array) -> int:
    """Period (samples) of a drive: where its autocorrelation, once negative, peaks."""
    size = 1 << (2 * len(drive) - 1).bit_length()
    spectrum = np.fft.rfft(drive - drive.mean(), size)
    correlation = np.fft.irfft(np.abs(spectrum) ** 2, size)[: len(drive)]
    first = int(np.argmax(correlation < 0.0))
    return first + int(np.argmax(correlation[first:]))


def _excited(drives: Array) -> NDArray[np.int64]:
    strength = np.abs(np.fft.rfft(drives, axis=1)).mean(axis=0)
    strength[0] = 0.0
    return np.flatnonzero(strength > EXCITED * strength.max())


def _lines(signals: Array, lines: NDArray[np.int64]) -> NDArray[np.complex128]:
    return np.asarray(np.fft.rfft(signals, axis=1)[:, lines])


def _average(
    spectra: list[tuple[NDArray[np.complex128], NDArray[np.complex128]]], omega: Array
) -> FrequencyResponse:
    """Weigh each wave by its input power, as least squares does."""
    inputs = np.array([given.mean(axis=0) for given, _ in spectra])
    outputs = np.array([got.mean(axis=0) for _, got in spectra])
    power = np.sum(np.abs(inputs) ** 2, axis=0)
    response = np.sum(outputs * inputs.conj(), axis=0) / power
    periods = [np.var(got, axis=0, ddof=1) / len(got) for _, got in spectra]
    noise = np.sqrt(np.mean(periods, axis=0) / power)
    spare = max(len(spectra) - 1, 1)
    left = np.sum(np.abs(outputs - response * inputs) ** 2, axis=0)
    return FrequencyResponse(omega, response, noise, np.sqrt(left / spare / power))
