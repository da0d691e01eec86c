"""Models of the fine steering mirror at all amplitudes, two realisations left out of everything.

A fold's two realisations, at every amplitude, teach nothing: no model, no start, no weight.
"""

from functools import cache

import numpy as np

from afm_scan_bench.measured.mirror.fits import (
    AMPLITUDES,
    HIGHEST,
    REALISATIONS,
    SAMPLE_PERIOD,
    measured,
    records,
)
from afm_scan_ros.core.identification.state_space.elements import FeedbackElement, Slips, Softening
from afm_scan_ros.core.identification.state_space.feedback import (
    FeedbackModel,
    SteadyRecords,
    fit_feedback,
)
from afm_scan_ros.core.identification.state_space.fit import fit_state_space
from afm_scan_ros.core.identification.state_space.model import StateSpaceModel
from afm_scan_ros.core.identification.state_space.spectra import Spectra, joined, reliability
from afm_scan_ros.core.types import Array

STATES = 36
FOLDS = ((0, 5), (1, 4), (2, 3))
"""Realisations left out together."""
MIDDLE = AMPLITUDES[1]
REFERENCE = 0.5
"""Of the softening's level, V: about the elongation's rms in the middle of the amplitudes."""
THRESHOLDS = (0.04, 0.1, 0.25)
"""Of the slips at the inputs, V: from below the least drive's rms to near the largest's."""

Fold = tuple[int, ...]


def fitted_to(fold: Fold) -> list[int]:
    """Realisations that a fold is fitted to."""
    return [k for k in REALISATIONS if k not in fold]


@cache
def spectra(amplitude: int, fold: Fold) -> Spectra:
    """Spectra of the fitted realisations at one amplitude, relative to their output's norm."""
    used = records(amplitude).of(fitted_to(fold))
    return used.spectra.weighted(_weight(amplitude, fold))


@cache
def steady_records(fold: Fold, amplitudes: tuple[int, ...] = AMPLITUDES) -> SteadyRecords:
    """Records of the fitted realisations, at several amplitudes."""
    parts = [periods(amplitude, fitted_to(fold)) for amplitude in amplitudes]
    drive, output = (np.concatenate(signals, axis=2) for signals in zip(*parts, strict=True))
    weight = np.concatenate([_weight(amplitude, fold) for amplitude in amplitudes], axis=1)
    return SteadyRecords(drive, output, weight, SAMPLE_PERIOD, HIGHEST)


@cache
def linear(amplitude: int, fold: Fold, states: int = STATES) -> StateSpaceModel:
    """Linear model of one amplitude."""
    return fit_state_space(spectra(amplitude, fold), states)


@cache
def linear_of_all(fold: Fold) -> StateSpaceModel:
    """One linear model of all amplitudes."""
    return fit_state_space(joined(spectra(amplitude, fold) for amplitude in AMPLITUDES), STATES)


def elongation(fold: Fold, amplitude: int = MIDDLE) -> Array:
    """Inverse static gain (3, 3), V/m: the drive that would hold the mirror where it is."""
    return np.linalg.inv(linear(amplitude, fold).response(np.zeros(1))[0].real)


@cache
def extended(fold: Fold) -> FeedbackModel:
    """The extended model: softening in feedback, slips at the inputs."""
    return extended_by((Softening(elongation(fold), REFERENCE), Slips(THRESHOLDS)), fold)


def extended_by(
    elements: tuple[FeedbackElement, ...], fold: Fold, amplitudes: tuple[int, ...] = AMPLITUDES
) -> FeedbackModel:
    """One model of several amplitudes with the elements, from the linear one of the second."""
    start = linear(amplitudes[1], fold)
    return fit_feedback(steady_records(fold, amplitudes), start, elements)


def left_out_errors(model: StateSpaceModel | FeedbackModel, amplitude: int, fold: Fold) -> Array:
    """Squared simulation error and squared output: (2, 3 outputs, left-out realisations), in m²."""
    drive, output = periods(amplitude, list(fold))
    return squared(simulated(model, drive), output)


def simulated(model: StateSpaceModel | FeedbackModel, drive: Array) -> Array:
    """Steady state (samples, 3, records) under periods of drive."""
    if isinstance(model, FeedbackModel):
        return model.steady_state(drive)
    return np.stack([model.steady_state(one) for one in np.moveaxis(drive, 2, 0)], axis=2)


def squared(simulation: Array, output: Array) -> Array:
    """Squared error, means removed, and squared output: (2, 3 outputs, records)."""
    error, own = (signal - signal.mean(axis=0) for signal in (simulation - output, output))
    return np.array([np.sum(error**2, axis=0), np.sum(own**2, axis=0)])


def percent(squares: Array) -> float:
    """Rms error over rms output, of all outputs together, in %: mean over the records."""
    return float(np.mean(100.0 * np.sqrt(squares[0].sum(axis=0) / squares[1].sum(axis=0))))


def periods(amplitude: int, realisations: list[int]) -> tuple[Array, Array]:
    """Drive in V and output in m, averaged over the periods: (samples, 3, realisations)."""
    found = measured(amplitude)
    drive, output = (
        signal[:, :, realisations].mean(axis=3) for signal in (found.drive, found.output)
    )
    return drive, output


def _weight(amplitude: int, fold: Fold) -> Array:
    used = fitted_to(fold)
    own = reliability(records(amplitude).of(used))
    return own / np.linalg.norm(periods(amplitude, used)[1])
