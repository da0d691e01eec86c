"""A linear structure with elements at its inputs and in its feedback, in steady state.

x[k+1] = A x + B u + E w, y = C x + D u + F w, w = elements(u, y): the form in which nonlinear
elements act inside a structure (M. Schoukens and R. Tóth, On the initialization of nonlinear LFR
model identification with the best linear approximation, 2020, arXiv:2004.05040), here with
elements of known shape.

Steady records at several amplitudes → one model with elements in its feedback.

What the elements add is known once the output is, and then all else is linear. First it is taken
from the measured outputs, then from the model's own, until it is that of the simulation.
"""

from collections.abc import Iterator, Sequence

import numpy as np
from attrs import evolve, frozen

from afm_scan_ros.core.errors import ScanError
from afm_scan_ros.core.identification.state_space.elements import FeedbackElement
from afm_scan_ros.core.identification.state_space.fit import gauss_newton
from afm_scan_ros.core.identification.state_space.model import Complex, StateSpaceModel
from afm_scan_ros.core.identification.state_space.modes import ModalForm, modal_form
from afm_scan_ros.core.identification.state_space.spectra import Spectra
from afm_scan_ros.core.types import Array

ROUNDS = 200
DEPTH = 20
"""Rounds that are mixed."""
BEYOND = 1e3
"""Of the output without elements, from which an output is one that will not settle."""
SETTLED = 1e-6
"""Change of the output in a round, over its rms, below which the steady state is found."""


@frozen(eq=False)
class FeedbackModel:
    """``linear`` takes the drive's m inputs, then those which the ``elements`` add, in turn.

    Up to ``highest``, in Hz: beyond the lines driven when it was identified it has no output.
    """

    linear: StateSpaceModel
    elements: tuple[FeedbackElement, ...]
    highest: float

    def steady_state(self, drives: Array) -> Array:
        """Outputs (samples, p, records) under periods of drives (samples, m, records).

        Elements and structure in turn until nothing changes. Raises ScanError where they do not
        settle.
        """
        frequency = np.fft.rfftfreq(len(drives), self.linear.sample_period)
        driven = frequency <= self.highest
        response = self.linear.response(np.asarray(2.0 * np.pi * frequency[driven]))
        outputs = [self._settled(drive, response) for drive in np.moveaxis(drives, 2, 0)]
        return np.stack(outputs, axis=2)

    def _settled(self, drive: Array, response: Complex) -> Array:
        outputs = [_driven(response[:, :, : drive.shape[1]], drive)]
        bound = BEYOND * np.abs(outputs[0]).max()
        changes: list[Array] = []
        for _ in range(ROUNDS):
            added = added_inputs(self.elements, drive, outputs[-1])
            changes.append(_driven(response, np.hstack([drive, *added])) - outputs[-1])
            if np.linalg.norm(changes[-1]) <= SETTLED * np.linalg.norm(outputs[-1]):
                return outputs[-1] + changes[-1]
            outputs.append(_mixed(outputs[-DEPTH:], changes[-DEPTH:]))
            if np.abs(outputs[-1]).max() > bound:
                break
        raise ScanError(
            f"steady state: not settled in {len(changes)} rounds: the drive is beyond the"
            " amplitudes for which the model was identified; drive less, or identify it there too"
        )


def _mixed(outputs: Sequence[Array], changes: Sequence[Array]) -> Array:
    """Next output, from the last ones and what a round changed each by.

    Were the loop linear, the least change that a mixture of them would see: Anderson, Iterative
    procedures for nonlinear integral equations, Journal of the ACM 12 (1965) 547-560.
    """
    flat = np.stack([change.ravel() for change in changes])
    slopes = np.diff(flat, axis=0)
    weights = np.linalg.lstsq(slopes.T, flat[-1], rcond=None)[0] if len(slopes) else np.zeros(0)
    moved = np.diff(np.stack(outputs), axis=0) + slopes.reshape(-1, *changes[-1].shape)
    return np.asarray(outputs[-1] + changes[-1] - np.tensordot(weights, moved, axes=1))


def added_inputs(
    elements: tuple[FeedbackElement, ...], drive: Array, output: Array
) -> Iterator[Array]:
    """What each element adds under a period of drive and output."""
    return (element.added(drive, output) for element in elements)


def _driven(response: Complex, inputs: Array) -> Array:
    """Output of a period of inputs (samples, ·) in steady state, at the response's lines alone."""
    spectrum = np.fft.rfft(inputs, axis=0)[: len(response), :, np.newaxis]
    output = np.zeros((len(inputs) // 2 + 1, response.shape[1]), dtype=np.complex128)
    output[: len(response)] = (response @ spectrum)[:, :, 0]
    return np.fft.irfft(output, len(inputs), axis=0)


@frozen(eq=False)
class SteadyRecords:
    """Periods in steady state of ``drive`` (samples, m, records), ``output`` (samples, p, records).

    ``weight`` (lines, records) is that of each line above zero up to ``highest`` Hz, the last
    line driven.
    """

    drive: Array
    output: Array
    weight: Array
    sample_period: float
    highest: float

    def spectra(self, elements: tuple[FeedbackElement, ...], output: Array) -> Spectra:
        """Spectra of the records with the inputs that the elements add under an ``output``."""
        added = [
            np.hstack([drive, *added_inputs(elements, drive, output[:, :, k])])
            for k, drive in enumerate(np.moveaxis(self.drive, 2, 0))
        ]
        frequency = np.fft.rfftfreq(len(self.drive), self.sample_period)
        used = (frequency > 0.0) & (frequency <= self.highest)
        inputs, outputs = (
            np.fft.rfft(signal, axis=0)[used] for signal in (np.stack(added, axis=2), self.output)
        )
        omega = np.asarray(2.0 * np.pi * frequency[used])
        return Spectra(omega, inputs, outputs, self.sample_period).weighted(self.weight)


def fit_feedback(
    records: SteadyRecords,
    start: StateSpaceModel,
    elements: tuple[FeedbackElement, ...],
    rounds: int = 1,
) -> FeedbackModel:
    """Fit A to F for the elements, from a linear model, with its number of states.

    ``rounds``: how often what the elements add is taken anew from the simulation. Raises
    ScanError where a simulation does not settle.
    """
    spectra = records.spectra(elements, records.output)
    form = gauss_newton(_widened(start, spectra.inputs.shape[1]), spectra)
    model = _model(form, records, elements)
    for _ in range(rounds):
        spectra = records.spectra(elements, model.steady_state(records.drive))
        form = gauss_newton(form, spectra)
        model = _model(form, records, elements)
    return model


def _model(
    form: ModalForm, records: SteadyRecords, elements: tuple[FeedbackElement, ...]
) -> FeedbackModel:
    return FeedbackModel(form.realised(records.sample_period), elements, records.highest)


def _widened(start: StateSpaceModel, inputs: int) -> ModalForm:
    """Modes of a model with further inputs, to which it does not respond yet."""
    form = modal_form(start.a, start.b, start.c, start.d)
    wide = ((0, 0), (0, inputs - start.b.shape[1]))
    return evolve(form, right=np.pad(form.right, wide), feedthrough=np.pad(form.feedthrough, wide))
