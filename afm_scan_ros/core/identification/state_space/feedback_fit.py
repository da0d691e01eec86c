"""Steady records at several amplitudes → one model with elements in its feedback.

What the elements add is known once the output is, and then all else is linear. First it is taken
from the measured outputs, then from the model's own, until it is that of the simulation.
"""

import numpy as np
from attrs import evolve, frozen

from afm_scan_ros.core.identification.state_space.elements import Element
from afm_scan_ros.core.identification.state_space.feedback import FeedbackModel, added_inputs
from afm_scan_ros.core.identification.state_space.gauss_newton import gauss_newton
from afm_scan_ros.core.identification.state_space.model import StateSpaceModel
from afm_scan_ros.core.identification.state_space.modes import ModalForm, modal_form
from afm_scan_ros.core.identification.state_space.spectra import Spectra
from afm_scan_ros.core.types import Array


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

    def spectra(self, elements: tuple[Element, ...], output: Array) -> Spectra:
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
    records: SteadyRecords, start: StateSpaceModel, elements: tuple[Element, ...], rounds: int = 1
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


def _model(form: ModalForm, records: SteadyRecords, elements: tuple[Element, ...]) -> FeedbackModel:
    return FeedbackModel(form.realised(records.sample_period), elements, records.highest)


def _widened(start: StateSpaceModel, inputs: int) -> ModalForm:
    """Modes of a model with further inputs, to which it does not respond yet."""
    form = modal_form(start.a, start.b, start.c, start.d)
    wide = ((0, 0), (0, inputs - start.b.shape[1]))
    return evolve(form, right=np.pad(form.right, wide), feedthrough=np.pad(form.feedthrough, wide))
