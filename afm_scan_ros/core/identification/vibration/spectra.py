"""Waves, each repeated → the frequency response between any number of inputs and outputs.

What differs from period to period of one wave is noise; what differs from wave to wave beyond it
is the input's nonlinear part, which no linear response to that input explains.
"""

import numpy as np
from attrs import evolve, frozen
from numpy.typing import NDArray

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import Array

Complex = NDArray[np.complex128]
SAME_LEVEL = 0.25
"""Relative step of amplitude that makes another level: draws of the phases differ by less."""
ALIKE = 1e8
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
    if waves < inputs or np.linalg.cond(information).max() > ALIKE:
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
