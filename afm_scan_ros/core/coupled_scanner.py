"""What is believed of a scanner whose axes are coupled, of n inputs and n outputs, and its inverse.

The inverse is that of the whole model in the band in which it was identified, and puts nothing out
beyond it: the optimal inverse (D. Croft, G. Shed and S. Devasia, J. Dyn. Syst. Meas. Control 123
(2001) 35, Eq. 22) of a brick-wall weight, for a matrix. What effects in feedback add is taken off
in turn until the model's displacement is the desired one.
"""

from collections.abc import Iterable
from functools import cached_property

import numpy as np
from attrs import frozen
from numpy.typing import ArrayLike
from scipy.fft import next_fast_len

from afm_scan_ros.core.arguments import period_of, refuse_other_count, samples
from afm_scan_ros.core.effects.effect_type import Actuators, FeedbackElement
from afm_scan_ros.core.effects.registry import coupled_form
from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.identification.state_space import feedback
from afm_scan_ros.core.identification.state_space.model import StateSpaceModel
from afm_scan_ros.core.limits import DriveLimits
from afm_scan_ros.core.types import Array

SAME_PERIOD = 1e-9
"""Relative difference of two sample periods that is rounding."""
LEFT_OUT = 0.01
"""Share of a signal that may be left out, also of a model whose own error is less."""


@frozen
class FeedbackEffect:
    """An effect of the catalogue in the structure's feedback, with its parameters' values."""

    name: str
    values: tuple[float, ...]


def elements_of(
    effects: tuple[FeedbackEffect, ...], actuators: Actuators
) -> tuple[FeedbackElement, ...]:
    """Return what effects consist of, in turn; raises InputError for an unknown name."""
    return tuple(
        element
        for effect in effects
        for element in coupled_form(effect.name).elements(actuators, effect.values)
    )


def valued(names: Iterable[str], actuators: Actuators) -> tuple[FeedbackEffect, ...]:
    """Effects with the values that they choose; raises InputError for an unknown name."""
    return tuple(FeedbackEffect(name, coupled_form(name).values(actuators)) for name in names)


@frozen
class LevelError:
    """Rms error (m) on records that the fit did not see, at one rms of the drive (V), all channels.

    ``by_band`` is the error over the displacement in parts of equal width of the model's band.
    """

    drive_rms: float
    error_rms: float
    displacement_rms: float
    by_band: tuple[float, ...]

    @property
    def relative(self) -> float:
        """Error over displacement."""
        return self.error_rms / self.displacement_rms


@frozen(eq=False, slots=False)
class CoupledScanner:
    """A coupled structure with its effects; ``axes`` names inputs and outputs.

    ``linear`` has the drives' inputs and then those that the effects add. ``band`` (Hz) is that of
    the lines driven, ``reach`` the largest drive (V) of its levels, ``errors`` what the model
    leaves of displacements, from the least level of the drive on. Raises InputError where the
    shapes of its parts disagree.
    """

    axes: tuple[str, ...]
    linear: StateSpaceModel
    band: tuple[float, float]
    effects: tuple[FeedbackEffect, ...]
    actuators: Actuators
    reach: float
    errors: tuple[LevelError, ...]

    def __attrs_post_init__(self) -> None:
        count = len(self.axes)
        still = np.zeros((1, count))
        scales = self.actuators.drive_scale.shape, self.actuators.elongation.shape
        if scales != ((count,), (count, count)) or self.linear.d.shape[0] != count:
            raise InputError(
                f"the model's scales have shapes {scales}, and its structure"
                f" {len(self.linear.d)} outputs, which are not those of {count} axes"
            )
        inputs = feedback.with_added(self.elements, still, still, 1).shape[1]
        if self.linear.d.shape[1] != inputs:
            raise InputError(
                f"the structure has {self.linear.d.shape[1]} inputs, where axes and effects ask for"
                f" {inputs}: list the effects that it was identified with"
            )

    @property
    def elements(self) -> tuple[FeedbackElement, ...]:
        """What the effects consist of."""
        return elements_of(self.effects, self.actuators)

    @cached_property
    def model(self) -> feedback.FeedbackModel:
        """The structure with its elements."""
        return feedback.FeedbackModel(self.linear, self.elements, self.band)

    @property
    def sample_period(self) -> float:
        """Sample period of the records, s, which is that of the model."""
        return self.linear.sample_period

    @property
    def relative_error(self) -> float:
        """Largest relative error of any level."""
        return max(error.relative for error in self.errors)

    def checked(self, what: str, given: ArrayLike, sample_period: float) -> Array:
        """Return a signal as (n, channels); raises InputError unless it suits the model."""
        values = samples(what, given)
        refuse_other_count(what, values, self.axes)
        period = period_of(sample_period)
        if abs(period / self.sample_period - 1.0) > SAME_PERIOD:
            raise InputError(
                f"sample_period is {period:.9g} s, and the model of coupled axes was identified at"
                f" {self.sample_period:.9g} s: resample {what} to that"
            )
        return values

    def predict(self, drive: Array, *, periodic: bool) -> Array:
        """Displacement (samples, p) of a drive (samples, m), from rest or as one whole period.

        Raises InputError for a drive beyond reach or band, ScanError where it does not settle.
        """
        for sample, channel in np.argwhere(np.abs(drive) > self.reach)[:1]:
            raise InputError(
                f"drive of {self.axes[channel]} is {drive[sample, channel]:.4g} V at sample"
                f" {sample}, and the model was identified to {self.reach:.4g} V: give a smaller"
                " drive"
            )
        self._refuse_out_of_band("drive", drive)
        return self._simulated(drive, periodic=periodic)

    def _simulated(self, drive: Array, *, periodic: bool) -> Array:
        if periodic:
            return self.model.steady_state(drive[:, :, np.newaxis])[:, :, 0]
        return self.model.from_rest(drive)

    def invert(self, desired: Array, *, periodic: bool) -> Array:
        """Drive (samples, m) of a displacement (samples, p), from rest or as one whole period.

        Raises InputError for one beyond the band, or not at rest at its ends, and ScanError where
        the inverse does not settle or leaves more than the model's error.
        """
        self._refuse_out_of_band("desired", desired)
        run = len(desired)
        rest = 0 if periodic else next_fast_len(run + 2 * self.model.decay) - run
        padded = np.pad(desired, ((0, rest), (0, 0)))
        drive = self._inverted(padded, run)[:run]
        self._refuse_beyond_reach(drive)
        self._refuse_untracked(drive, desired, periodic=periodic)
        return drive

    def _inverted(self, desired: Array, run: int) -> Array:
        response = self.model.response(len(desired), len(self.axes))
        own = response[:, :, : len(self.axes)]
        inverse = np.asarray(np.linalg.pinv(own), dtype=np.complex128)

        def missing(drive: Array) -> Array:
            """Drive that a drive lacks, were the outputs the desired ones."""
            inputs = feedback.with_added(self.elements, drive, desired, run)
            inputs[:, : drive.shape[1]] = drive
            return feedback.output_of(inverse, desired - feedback.output_of(response, inputs))

        return feedback.fixed_point(missing, feedback.output_of(inverse, desired), "inverse")

    def _refuse_out_of_band(self, what: str, signal: Array) -> None:
        """Raise InputError where more of a signal than may be left out is above the band."""
        power = np.sum(np.abs(np.fft.rfft(signal, axis=0)) ** 2, axis=1)
        above = np.fft.rfftfreq(len(signal), self.sample_period) > self.band[1]
        share = float(np.sqrt(power[above].sum() / max(power.sum(), np.finfo(float).tiny)))
        if share > max(self.relative_error, LEFT_OUT):
            raise InputError(
                f"{what}: {share:.1%} of it is above {self.band[1]:.5g} Hz, up to which the"
                f" model was identified with an error of {self.relative_error:.1%}: smooth it"
            )

    def _refuse_beyond_reach(self, drive: Array) -> None:
        for sample, channel in np.argwhere(np.abs(drive) > self.reach)[:1]:
            raise ScanError(
                f"sample {sample}, axis {self.axes[channel]}: drive [V] ="
                f" {drive[sample, channel]:.6g} is beyond the {self.reach:.4g} V that the model was"
                " identified to: move less, or identify a wider range"
            )

    def refuse_beyond(self, drive: Array, limits: DriveLimits) -> None:
        """Raise ScanError for the first sample beyond the amplifier's voltage or slew."""
        slope = np.diff(drive, axis=0, prepend=drive[:1]) / self.sample_period
        for quantity, values, limit in (
            ("drive [V]", drive, limits.voltage),
            ("slope of the drive [V/s]", slope, limits.slew),
        ):
            for sample, channel in np.argwhere(np.abs(values) > limit)[:1]:
                raise ScanError(
                    f"sample {sample}, axis {self.axes[channel]}: {quantity} ="
                    f" {values[sample, channel]:.6g} is beyond the amplifier's {limit:g}: move less"
                    " or more slowly"
                )

    def _refuse_untracked(self, drive: Array, desired: Array, *, periodic: bool) -> None:
        """Raise InputError where the model does not follow by the drive that is returned."""
        left = self._simulated(drive, periodic=periodic) - desired
        share = float(np.linalg.norm(left) / max(np.linalg.norm(desired), np.finfo(float).tiny))
        if share > max(self.relative_error, LEFT_OUT):
            raise InputError(
                f"desired: no drive within its {len(desired)} samples makes the model follow to"
                f" less than {share:.1%} of it: let it begin and end at rest at zero, for"
                f" {self.model.decay * self.sample_period:.3g} s each, or give whole periods"
            )
