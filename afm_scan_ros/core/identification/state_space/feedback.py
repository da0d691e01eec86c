"""A linear structure with elements at its inputs and in its feedback, and its fit to records.

x[k+1] = A x + B u + E w, y = C x + D u + F w, w = elements(u, y): see core/effects/effect_type.py.

What the elements add is known once the output is, and then all else is linear. For a simulation it
is found in turn with the output. In a fit it is first taken from the measured outputs, then from
the model's own. Source of the mixed iteration: Anderson, Iterative procedures for nonlinear
integral equations, Journal of the ACM 12 (1965) 547-560.
"""

from collections.abc import Callable, Sequence

import numpy as np
from attrs import evolve, frozen
from numpy.typing import NDArray
from scipy.fft import next_fast_len

from afm_scan_ros.core.effects.effect_type import FeedbackElement
from afm_scan_ros.core.errors import ScanError
from afm_scan_ros.core.identification.state_space.fit import gauss_newton
from afm_scan_ros.core.identification.state_space.model import (
    ModalForm,
    StateSpaceModel,
    modal_form,
)
from afm_scan_ros.core.identification.state_space.spectra import Spectra
from afm_scan_ros.core.types import Array, Complex

ROUNDS = 200
DEPTH = 20
"""Rounds that are mixed."""
BEYOND = 1e3
"""Of the first signal, from which one will not settle."""
SETTLED = 1e-6
"""Change of the signal in a round, over its rms, below which it is found."""


def fixed_point(change: Callable[[Array], Array], start: Array, what: str) -> Array:
    """Return the signal that has no ``change``, from a start.

    Raises ScanError, naming ``what`` is done, where none is found.
    """
    signals, changes = [start], [change(start)]
    bound = BEYOND * np.abs(start).max()
    while np.linalg.norm(changes[-1]) > SETTLED * np.linalg.norm(signals[-1]):
        following = _mixed(signals[-DEPTH:], changes[-DEPTH:])
        if len(changes) == ROUNDS or not np.abs(following).max() <= bound:
            raise ScanError(
                f"{what}: not settled in {len(changes)} rounds: the motion is beyond the amplitudes"
                " for which the model was identified; move less, or identify it there too"
            )
        signals.append(following)
        changes.append(change(following))
    return np.asarray(signals[-1] + changes[-1])


def _mixed(signals: Sequence[Array], changes: Sequence[Array]) -> Array:
    """Return the next signal: were the loop linear, the one of the least change."""
    flat = np.stack([change.ravel() for change in changes])
    slopes = np.diff(flat, axis=0)
    weights = np.linalg.lstsq(slopes.T, flat[-1], rcond=None)[0] if len(slopes) else np.zeros(0)
    moved = np.diff(np.stack(signals), axis=0) + slopes.reshape(-1, *changes[-1].shape)
    return np.asarray(signals[-1] + changes[-1] - np.tensordot(weights, moved, axes=1))


COARSE = 4
"""Every so many lines are taken first: a fit to them leads the other near its minimum."""


@frozen(eq=False)
class FeedbackModel:
    """``linear`` takes the drive's m inputs, then those which the ``elements`` add, in turn.

    ``band`` (Hz) is that of the lines driven when it was identified. Above it there is no output,
    and below it none of what the elements add.
    """

    linear: StateSpaceModel
    elements: tuple[FeedbackElement, ...]
    band: tuple[float, float]

    def steady_state(self, drives: Array) -> Array:
        """Outputs (samples, p, records) under periods of drives (samples, m, records).

        Raises ScanError where elements and structure do not settle. The largest drive is the
        likeliest not to, so it comes first.
        """
        response = self.response(*drives.shape[:2])
        outputs = np.empty((len(drives), response.shape[1], drives.shape[2]))
        for k in np.argsort(-np.sum(drives**2, axis=(0, 1))):
            outputs[:, :, k] = self._settled(drives[:, :, k], response, len(drives))
        return outputs

    def from_rest(self, drive: Array) -> Array:
        """Outputs (samples, p) of a drive (samples, m) from rest; raises as ``steady_state``."""
        run = len(drive)
        padded = np.pad(drive, ((0, next_fast_len(run + self.decay) - run), (0, 0)))
        return self._settled(padded, self.response(*padded.shape), run)[:run]

    @property
    def decay(self) -> int:
        """Samples in which the structure comes to rest."""
        slowest = np.abs(self.linear.poles).max(initial=0.0)
        return int(np.ceil(np.log(SETTLED) / np.log(slowest))) if slowest else 1

    def response(self, samples: int, inputs: int) -> Complex:
        """Response at the lines of so many samples, from zero to the band's end: (lines, p, ·)."""
        frequency = np.fft.rfftfreq(samples, self.linear.sample_period)
        low, high = self.band
        response = self.linear.response(np.asarray(2.0 * np.pi * frequency[frequency <= high]))
        response[frequency[: len(response)] < low, :, inputs:] = 0.0
        return response

    def _settled(self, drive: Array, response: Complex, run: int) -> Array:
        """Output of a period of which the first ``run`` samples are driven."""
        linear = output_of(response[:, :, : drive.shape[1]], drive)
        if not self.elements:
            return linear

        def change(output: Array) -> Array:
            return output_of(response, with_added(self.elements, drive, output, run)) - output

        return fixed_point(change, linear, "simulation")


def with_added(
    elements: tuple[FeedbackElement, ...], drive: Array, output: Array, run: int
) -> Array:
    """Drive (samples, m) and what each element adds to it, which is nothing after the ``run``."""
    added = np.hstack([drive, *(element.added(drive, output, run) for element in elements)])
    added[run:] = 0.0
    return added


def output_of(response: Complex, inputs: Array) -> Array:
    """Output of a period of inputs (samples, ·) in steady state, of the response's lines alone."""
    spectrum = np.fft.rfft(inputs, axis=0)[: len(response), :, np.newaxis]
    output = np.zeros((len(inputs) // 2 + 1, response.shape[1]), dtype=np.complex128)
    output[: len(response)] = (response @ spectrum)[:, :, 0]
    return np.fft.irfft(output, len(inputs), axis=0)


@frozen(eq=False)
class SteadyRecords:
    """Periods in steady state of ``drive`` (samples, m, records), ``output`` (samples, p, records).

    ``used`` (samples // 2 + 1,) marks the lines driven, and ``weight`` (lines, records) is theirs.
    """

    drive: Array
    output: Array
    used: NDArray[np.bool_]
    weight: Array
    sample_period: float

    @property
    def band(self) -> tuple[float, float]:
        """Frequencies of the first and the last line driven, Hz."""
        driven = np.fft.rfftfreq(len(self.drive), self.sample_period)[self.used]
        return float(driven.min()), float(driven.max())

    def spectra(self, elements: tuple[FeedbackElement, ...], output: Array) -> Spectra:
        """Spectra of the records with the inputs that the elements add under an ``output``."""
        samples = len(self.drive)
        inputs = np.stack(
            [
                with_added(elements, drive, output[:, :, k], samples)
                for k, drive in enumerate(np.moveaxis(self.drive, 2, 0))
            ],
            axis=2,
        )
        driven, moved = (np.fft.rfft(signal, axis=0)[self.used] for signal in (inputs, self.output))
        omega = np.asarray(2.0 * np.pi * np.fft.rfftfreq(samples, self.sample_period)[self.used])
        return Spectra(omega, driven, moved, self.sample_period).weighted(self.weight)


def fit_feedback(
    records: SteadyRecords,
    start: StateSpaceModel,
    elements: tuple[FeedbackElement, ...],
    step: int = 1,
) -> FeedbackModel:
    """Fit A to F for the elements, from a model of the drives' inputs or of all, of its order.

    The fit takes every ``step``-th line. Raises ScanError where the simulation does not settle.
    """
    spectra = records.spectra(elements, records.output).every(step)
    form = _widened(start, spectra.inputs.shape[1])
    form = gauss_newton(gauss_newton(form, spectra.every(COARSE)), spectra)
    simulated = _model(form, records, elements).steady_state(records.drive)
    spectra = records.spectra(elements, simulated).every(step)
    return _model(gauss_newton(form, spectra), records, elements)


def _model(
    form: ModalForm, records: SteadyRecords, elements: tuple[FeedbackElement, ...]
) -> FeedbackModel:
    return FeedbackModel(form.realised(records.sample_period), elements, records.band)


def _widened(start: StateSpaceModel, inputs: int) -> ModalForm:
    """Modes of a model with further inputs, to which it does not respond yet."""
    form = modal_form(start.a, start.b, start.c, start.d)
    wide = ((0, 0), (0, inputs - start.b.shape[1]))
    return evolve(form, right=np.pad(form.right, wide), feedthrough=np.pad(form.feedthrough, wide))
