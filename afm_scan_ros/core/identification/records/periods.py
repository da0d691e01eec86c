"""Records of repeated waves → their spectra, and the response between any inputs and outputs.

What differs from period to period of one wave is noise; what differs from wave to wave beyond it
is the input's nonlinear part, which no linear response to that input explains.
"""

import numpy as np
from attrs import evolve, frozen
from numpy.typing import NDArray
from scipy.fft import irfft, next_fast_len, rfft

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import Array

Complex = NDArray[np.complex128]
SAME_LEVEL = 0.25
"""Relative step of amplitude that makes another level: draws of the phases differ by less."""
ILL_CONDITIONED = 1e8
"""Condition number beyond which the inputs are driven alike."""


@frozen(eq=False)
class RecordSpectra:
    """Discrete Fourier transforms at the excited lines, one for each wave, mean of its periods.

    ``noise`` is the variance of an output's mean over the ``periods`` of its wave.
    """

    omega: Array
    """rad/s, (lines,)"""
    inputs: Complex
    """(waves, lines, inputs)"""
    outputs: Complex
    """(waves, lines, outputs)"""
    noise: Array
    """(waves, lines, outputs)"""
    periods: Array
    """(waves,)"""

    @property
    def amplitudes(self) -> Array:
        """Strength of each wave's inputs, (waves,), in multiples that compare waves alone."""
        return np.asarray(np.sqrt(np.sum(np.abs(self.inputs) ** 2, axis=(1, 2))))

    def levels(self) -> "list[RecordSpectra]":
        """Waves of about the same amplitude together, the strongest first."""
        order = np.argsort(-self.amplitudes, kind="stable")
        falls = np.flatnonzero(np.diff(np.log(self.amplitudes[order])) < -SAME_LEVEL) + 1
        groups = np.split(order, falls)
        return [self.only(np.isin(np.arange(len(order)), group)) for group in groups]

    def advanced(self, delay: float) -> "RecordSpectra":
        """The waves as they were if the outputs came ``delay`` s earlier."""
        early = np.exp(1j * self.omega * delay)[:, np.newaxis]
        return evolve(self, outputs=self.outputs * early)

    def only(self, waves: NDArray[np.bool_]) -> "RecordSpectra":
        """The waves chosen by a mask, (waves,)."""
        return RecordSpectra(
            self.omega,
            self.inputs[waves],
            self.outputs[waves],
            self.noise[waves],
            self.periods[waves],
        )


@frozen(eq=False)
class LineResponses:
    """Response of the sampled system, (lines, outputs, inputs), and how far it is known.

    ``noise`` and ``scatter``, both of the response's shape, are its standard deviation as the
    differences from period to period and from wave to wave give it. ``coherence``, (lines,
    outputs), is the share of the outputs' power that the inputs explain, period by period.
    ``weights``, (waves, outputs), are how much each wave counted; their mean is 1.
    """

    omega: Array
    response: Complex
    noise: Array
    scatter: Array
    coherence: Array
    weights: Array


def response_matrix(spectra: RecordSpectra) -> LineResponses:
    """Least squares over the waves, those noisier between their periods counting less.

    Raises InputError where the waves cannot separate the inputs.
    """
    waves, _, inputs = spectra.inputs.shape
    information = np.einsum("rlj,rlk->ljk", spectra.inputs.conj(), spectra.inputs)
    if waves < inputs or np.linalg.cond(information).max() > ILL_CONDITIONED:
        raise InputError(
            f"frequency record: {waves} waves cannot separate {inputs} inputs; drive at least"
            f" {inputs} waves whose phases differ from input to input"
        )
    found = [_one_output(spectra, output) for output in range(spectra.outputs.shape[2])]
    response, noise, scatter, coherence, weights = (
        np.stack(part, axis=1) for part in zip(*found, strict=True)
    )
    return LineResponses(spectra.omega, response, noise, scatter, coherence, weights)


def _one_output(spectra: RecordSpectra, output: int) -> tuple[Complex, Array, Array, Array, Array]:
    """Response, noise and scatter, (lines, inputs), coherence, (lines,), and weights, (waves,)."""
    measured, noise = spectra.outputs[:, :, output], spectra.noise[:, :, output]
    evenly = np.ones(len(measured))
    residual, variance, _ = _residual(spectra, measured, noise, evenly)
    distortion = max(float(np.mean(variance - noise.mean(axis=0))), 0.0)
    weights = _normalised(noise.mean(axis=1) + distortion)
    residual, variance, solution = _residual(spectra, measured, noise, weights)
    response = np.einsum("ljr,rl->lj", solution, measured)
    own = np.sqrt(np.einsum("ljr,rl->lj", np.abs(solution) ** 2, noise))
    spread = np.sum(np.abs(solution) ** 2 / weights, axis=2)
    scatter = np.sqrt(spread * variance[:, np.newaxis])
    return response, own, scatter, _coherence(residual, measured, noise, spectra.periods), weights


def _residual(
    spectra: RecordSpectra, measured: Complex, noise: Array, weights: Array
) -> tuple[Complex, Array, Complex]:
    """The residual, (waves, lines), its variance at weight 1, (lines,), and the solving matrix.

    Where there are no more waves than inputs there is no residual, and the noise stands for it.
    """
    inputs = np.moveaxis(spectra.inputs, 0, 1)
    weighed = inputs.conj().swapaxes(1, 2) * weights
    solution = np.asarray(np.linalg.solve(weighed @ inputs, weighed), np.complex128)
    residual = measured - np.einsum("lrj,ljs,sl->rl", inputs, solution, measured)
    spare = inputs.shape[1] - inputs.shape[2]
    if spare == 0:
        return residual, np.mean(weights[:, np.newaxis] * noise, axis=0), solution
    return (
        residual,
        np.sum(weights[:, np.newaxis] * np.abs(residual) ** 2, axis=0) / spare,
        solution,
    )


def _normalised(variance: Array) -> Array:
    """Weights of mean 1 for waves of this variance, equal where nothing varies at all."""
    if not variance.any():
        return np.ones_like(variance)
    weights = 1.0 / np.maximum(variance, np.finfo(float).eps * variance.max())
    return np.asarray(weights / weights.mean())


def _coherence(residual: Complex, measured: Complex, noise: Array, periods: Array) -> Array:
    counts = periods[:, np.newaxis]
    within = counts * (counts - 1.0) * noise
    unexplained = np.sum(counts * np.abs(residual) ** 2 + within, axis=0)
    return np.asarray(1.0 - unexplained / np.sum(counts * np.abs(measured) ** 2 + within, axis=0))


EXCITED = 1e-3
"""Lines of the drive below this share of its strongest are not excited."""
EQUAL = 1e-6
"""Share of the drive's range by which two periods may differ and be equal: rounding, no noise."""
NEAR = 0.05
"""Share of the period by which the peak may be drawn forward: 1/(8 pi^2) of a sine's, thrice."""
REPEATING = 0.5
"""Pieces that differ by less than this share of themselves repeat, if only nearly."""


def is_periodic(drive: Array) -> bool:
    """Whether some period of a drive, (n, inputs), comes three times in succession or more."""
    return bool(steady_runs(drive))


def refuse_out_of_step(drive: Array) -> None:
    """Refuse a drive, (n, inputs), that nearly repeats, as one out of step with the sampling does.

    Raises InputError.
    """
    drives = _periods(drive, repetition(drive))
    if len(drives) > 1 and _alike(drives):
        raise InputError(_unsteady(drives))


def _alike(drives: Array) -> bool:
    """Whether pieces of a drive, (pieces, period, inputs), nearly repeat."""
    return bool(np.linalg.norm(drives[1:] - drives[:-1]) < REPEATING * np.linalg.norm(drives))


def record_spectra(
    drive: Array, effective: Array, output: Array, sample_period: float
) -> RecordSpectra:
    """RecordSpectra of a record: drive and effective input (n, inputs), output (n, outputs).

    A period counts when the drive moves and equals the period before, so that it is steady. Raises
    InputError where no two periods in succession are.
    """
    period = repetition(drive)
    runs = _runs(drive, period)
    drives, inputs, outputs = (_periods(signal, period) for signal in (drive, effective, output))
    if not runs:
        raise InputError(_unsteady(drives))
    lines = _excited(drives[np.concatenate(runs)])
    omega = np.asarray(lines * (2.0 * np.pi / (drives.shape[1] * sample_period)), dtype=np.float64)
    given, got = ([_lines(signal[run], lines) for run in runs] for signal in (inputs, outputs))
    return RecordSpectra(
        omega,
        np.array([wave.mean(axis=0) for wave in given]),
        np.array([wave.mean(axis=0) for wave in got]),
        np.array([np.var(wave, axis=0, ddof=1) / len(wave) for wave in got]),
        np.array([float(len(run)) for run in runs]),
    )


def _periods(signal: Array, period: int) -> Array:
    """Cut a signal, (n, channels), into periods of so many samples, (periods, period, channels)."""
    count = len(signal) // period
    return signal[: count * period].reshape(count, period, signal.shape[1])


def steady_runs(drive: Array) -> list[NDArray[np.int64]]:
    """Numbers of the steady periods of a drive, (n, inputs), run by run."""
    return _runs(drive, repetition(drive))


def _runs(drive: Array, period: int) -> list[NDArray[np.int64]]:
    if not period:
        return []
    drives = _periods(drive, period)
    apart = np.abs(np.diff(drives, axis=0)).max(axis=(1, 2), initial=0.0)
    moving = np.ptp(drives[1:], axis=1).max(axis=1, initial=0.0) > 0.0
    steady = 1 + np.flatnonzero((apart <= EQUAL * np.ptp(drive)) & moving)
    runs = np.split(steady, np.flatnonzero(np.diff(steady) > 1) + 1)
    return [run for run in runs if len(run) > 1]


def repetition(drive: Array) -> int:
    """Period (samples) of a drive, (n, inputs).

    Ramps and rests before and after hide it from a drive's values, or show several periods for one,
    but not from its steps, which count where the drive is steady at their period.
    """
    period = _repetition(drive)
    if len(drive) > 1:
        other = _repetition(np.diff(drive, axis=0))
        if _runs(drive, other) and (other < period or not _runs(drive, period)):
            return other
    return period


def _repetition(signal: Array) -> int:
    """Period (samples) of a signal: where its autocorrelation, once negative, peaks.

    The shorter overlap at longer lags draws a broad peak forward. About it the period is therefore
    the lag at which the signal differs least from itself.
    """
    size = next_fast_len(2 * len(signal), real=True)
    moves = signal - signal.mean(axis=0)
    power = np.sum(np.abs(rfft(moves, size, axis=0)) ** 2, axis=1)
    correlation = irfft(power, size)[: len(signal)]
    first = int(np.argmax(correlation < 0.0))
    peak = first + int(np.argmax(correlation[first:]))
    lags = np.arange(round((1.0 - NEAR) * peak), min(round((1.0 + NEAR) * peak) + 1, len(signal)))
    energy = np.concatenate([[0.0], np.cumsum(np.sum(moves**2, axis=1))])
    both = energy[len(signal) - lags] + energy[-1] - energy[lags]
    return int(lags[np.argmin((both - 2.0 * correlation[lags]) / (len(signal) - lags))])


def _unsteady(drives: Array) -> str:
    """Word why none of the pieces of a drive, (pieces, period, inputs), is steady."""
    count, period = drives.shape[:2]
    problem = (
        "nearly repeats itself but never exactly: it is not synchronised with the sampling; drive"
        " periods of a whole number of samples, from the sampling's own clock"
        if count > 1 and _alike(drives)
        else "is never three times the same; drive a periodic multisine from the record's start"
    )
    return f"frequency record: the drive, taken in {count} pieces of {period} samples, {problem}"


def _excited(drives: Array) -> NDArray[np.int64]:
    strength = np.abs(np.fft.rfft(drives, axis=1)).mean(axis=(0, 2))
    strength[0] = 0.0
    return np.flatnonzero(strength > EXCITED * strength.max())


def _lines(signals: Array, lines: NDArray[np.int64]) -> Complex:
    return np.asarray(np.fft.rfft(signals, axis=1)[:, lines])
