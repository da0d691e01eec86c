"""A scanner's model, which predicts and inverts."""

import logging
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Literal, overload

import numpy as np
from attrs import evolve, field, frozen
from numpy.typing import ArrayLike

from afm_scan_ros.core.arguments import (
    LIMITS,
    all_of_type,
    of_type,
    period_of,
    positive,
    refuse_other_count,
    samples,
)
from afm_scan_ros.core.compensation import Compensation
from afm_scan_ros.core.effects.hysteresis.everett import BeyondRangeError
from afm_scan_ros.core.effects.optimal_inverse import RelativeWeight, SmoothWeight
from afm_scan_ros.core.effects.sensor import led
from afm_scan_ros.core.effects.vibration import LARGEST_TAIL
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.intersample import HELD, upsampling, voltages_of
from afm_scan_ros.core.limits import DriveLimits
from afm_scan_ros.core.model import INVERSES, BaseEffects, InverseSettings, ScannerModel
from afm_scan_ros.core.prediction import SHARE, extended, standard_deviation
from afm_scan_ros.core.scanner import predict
from afm_scan_ros.core.types import AXES, Array, Trace, channels_of, trace_of
from afm_scan_ros.files import model_file, share_directory, version, yaml
from afm_scan_ros.files.paths import path_of
from afm_scan_ros.report.sentences import unknown_effects

if TYPE_CHECKING:
    from afm_scan_ros.core.coupled_scanner import CoupledScanner
    from afm_scan_ros.core.identification.identify import Identification

LOG = logging.getLogger(__name__)

MODEL_FILE = "model.yaml"
BEYOND = {"refuse": 0.0, "extend": SHARE}
"""Shares by which a drive may leave the identified range."""
UNLIMITED = DriveLimits(float("inf"), float("inf"))


def _share_of(beyond: str | float) -> float:
    """Return the share by which a drive may leave the identified range; raises InputError."""
    if isinstance(beyond, str) and beyond in BEYOND:
        return BEYOND[beyond]
    if isinstance(beyond, str):
        raise InputError(f"beyond is {beyond!r}: give {', '.join(BEYOND)} or a number, as 0.5")
    return positive("beyond", beyond, "as 0.5 for a half more")


@frozen(eq=False)
class Model:
    """Creep, hysteresis and vibration of one axis or of both, and effects added by ``diagnose``.

    Or the vibration of any number of coupled axes, with effects added by ``identify``. Made by
    ``identify``, ``load_model`` and ``diagnose``. ``scanner`` holds the models of the axes,
    ``coupled`` that of coupled axes, ``origin`` states where they are from.

    >>> import numpy as np
    >>> import afm_scan_ros as afm
    >>> model = afm.load_model()
    >>> desired = np.zeros((2000, 2))
    >>> desired[:, 0] = 5e-6 * np.sin(np.linspace(0.0, np.pi, 2000)) ** 2
    >>> drive = model.invert(desired, sample_period=1e-4)
    >>> moved = model.predict(drive, sample_period=1e-4)
    >>> bool(np.abs(moved - desired).max() < 20e-9)
    True
    """

    _scanner: "ScannerModel | CoupledScanner" = field(repr=False)
    origin: str
    _identification: "Identification | None" = field(default=None, repr=False)

    @property
    def axes(self) -> tuple[str, ...]:
        """Names of the axes, in the order of the channels."""
        return self._scanner.axes

    @property
    def scanner(self) -> ScannerModel:
        """Models of x and y; raises InputError for a model of coupled axes."""
        if not isinstance(self._scanner, ScannerModel):
            raise InputError(
                f"{self.origin}: is a model of coupled axes, and this needs one of x and y"
            )
        return self._scanner

    @property
    def is_coupled(self) -> bool:
        """Whether it is a model of coupled axes."""
        return not isinstance(self._scanner, ScannerModel)

    @property
    def coupled(self) -> "CoupledScanner":
        """Model of coupled axes, with its errors; raises InputError for one of x and y."""
        if isinstance(self._scanner, ScannerModel):
            raise InputError(f"{self.origin}: is no model of coupled axes")
        return self._scanner

    @property
    def effects(self) -> Mapping[str, BaseEffects]:
        """How creep, hysteresis and vibration of each axis are known, and where that holds.

        >>> import afm_scan_ros as afm
        >>> afm.load_model().effects["x"].creep.status.value
        'identified'
        """
        return {name: self.scanner.axis(name).effects for name in self.axes}

    @property
    def fit(self) -> "Identification":
        """What the model was identified by, axis by axis: fits, intervals, warnings, residuals.

        Raises InputError for a model that was not made by ``identify``: a file does not hold it.
        """
        if self._identification is None:
            raise InputError(f"{self.origin}: holds no fit: 'identify' makes models that do")
        return self._identification

    @overload
    def predict(
        self,
        drive: ArrayLike,
        sample_period: float,
        *,
        beyond: str | float = ...,
        return_std: Literal[False] = ...,
        periodic: bool = ...,
        intersample: str = ...,
    ) -> Array: ...

    @overload
    def predict(
        self,
        drive: ArrayLike,
        sample_period: float,
        *,
        beyond: str | float = ...,
        return_std: Literal[True],
        periodic: bool = ...,
        intersample: str = ...,
    ) -> tuple[Array, Array]: ...

    def predict(
        self,
        drive: ArrayLike,
        sample_period: float,
        *,
        beyond: str | float = "refuse",
        return_std: bool = False,
        periodic: bool = False,
        intersample: str = HELD,
    ) -> Array | tuple[Array, Array]:
        """Return the displacement (m) for a drive (V), from depolarised rest at zero.

        Parameters
        ----------
        drive
            V, shape (n,) or (n, channels).
        sample_period
            s.
        beyond
            "refuse" a drive that leaves the identified range, or "extend" that range by a tenth of
            the voltage at either end, or a number, as 0.5 for a half of it: branches go on with the
            slopes that they have there.
        return_std
            Whether to return the standard deviation of the prediction too.
        periodic
            Of coupled axes, whether the drive holds whole periods, in steady state.
        intersample
            How the drive runs between its samples, as of ``Record``: "held" or "band_limited".

        Returns
        -------
        moved : ndarray
            m, of the drive's shape. Effects that are unknown are left out; a warning in the log
            names them.
        std : ndarray
            m, of the drive's shape, without the sensor's noise: how far the parameters may be from
            those found, which varies along the drive, and the error that is left on records, over
            their motion. A model that states no ``spread`` has the rms error that its records
            foresee of such motion. Beyond the identified range it also holds how far the
            prediction is from a straight line there. It is about the mean where no identified
            record began at rest, since none tells how far motion lies from there. Only where
            ``return_std``.

        Raises
        ------
        InputError
            For arrays that are not of the model's axes, where the drive leaves the range, and where
            a standard deviation is asked of a model that states no error.

        Examples
        --------
        >>> import numpy as np
        >>> import afm_scan_ros as afm
        >>> drive = np.zeros((2000, 2))
        >>> drive[:, 0] = np.sin(np.linspace(0.0, 2.0 * np.pi, 2000))
        >>> moved, std = afm.load_model().predict(drive, 1e-4, return_std=True)
        >>> bool(std[:, 0].max() < 1e-2 * np.ptp(moved[:, 0]))
        True
        """
        share = _share_of(beyond)
        if not isinstance(self._scanner, ScannerModel):
            if return_std or share or intersample != HELD:
                raise InputError(
                    "a model of coupled axes predicts neither beyond its range, nor a standard"
                    " deviation, nor between samples: leave out beyond, return_std and intersample"
                )
            return self._scanner.predict(
                self._scanner.checked("drive", drive, sample_period), periodic=periodic
            )
        self._refuse_periodic(periodic=periodic)
        self._warn_of_unknown_effects()
        given = self._trace("drive", drive, sample_period)
        given = self._led(given) if intersample == HELD else given
        voltages, every = voltages_of(given, intersample), upsampling(intersample)
        model = extended(self.scanner, voltages, share) if share else self.scanner
        try:
            fine = predict(model, voltages)
        except BeyondRangeError as error:
            farther = f", of which {share:.0%} more may be predicted" if share else ""
            raise InputError(
                f"drive is {error.value:.4g} V at sample {error.sample // every}, and the model was"
                f" identified to {error.limit:.4g} V{farther}: give a smaller drive"
            ) from None
        moved = Trace(0, given.sample_period, fine.x[::every], fine.y[::every])
        if not return_std:
            return self._like(drive, moved)
        deviation = standard_deviation(self.scanner, given, moved, share or SHARE, intersample)
        return self._like(drive, moved), self._like(drive, deviation)

    def _led(self, drive: Trace) -> Trace:
        """Return a drive (V) as for a displacement that is read just before its updates."""
        ahead = {
            name: led(drive.axis(name))
            for name in self.scanner.axes
            if self.scanner.axis(name).reads_after
        }
        both = (ahead.get(name, drive.axis(name)) for name in AXES)
        return Trace(drive.first_sample, drive.sample_period, *both)

    def invert(
        self,
        desired: ArrayLike,
        sample_period: float,
        effects: Iterable[str] | None = None,
        limits: DriveLimits | None = None,
        weight: float | None = None,
        *,
        periodic: bool = False,
    ) -> Array:
        """Return the drive (V) that makes the scanner follow a displacement (m).

        Parameters
        ----------
        desired
            m, shape (n,) or (n, channels), from depolarised rest at zero on. A warning in the log
            names an axis that begins elsewhere, which its first samples cannot follow.
        sample_period
            s.
        effects
            Those to invert, of "creep", "hysteresis" and "vibration"; all where None. Each other
            one counts by its gain at rest, and so does each that is unknown; a warning in the log
            names these.
        limits
            The amplifier's voltage and slew; none where None.
        weight
            Frequency (Hz) above which the inverse of vibration prefers a small drive to a small
            error; 11 times the first resonance of each axis where None.
        periodic
            Of coupled axes, whether ``desired`` is whole periods, in steady state.

        Returns
        -------
        ndarray
            V, of the shape of ``desired``.

        Raises
        ------
        InputError
            For arrays that are not of the model's axes and for an unknown effect.
        ScanError
            Where the drive leaves the limits or the range that the model was identified in; it
            names sample and axis.

        Notes
        -----
        The effects are inverted in the order creep, vibration, hysteresis (Croft, Shed and Devasia
        2001, Eq. 23), vibration by the optimal inverse of Eq. 22. The inverse of coupled axes is
        that of the whole model in the band that was identified.
        """
        of_type(DriveLimits, "limits", limits or UNLIMITED, LIMITS)
        if not isinstance(self._scanner, ScannerModel):
            for name, value in {"effects": effects, "weight": weight}.items():
                if value is not None:
                    raise InputError(f"{name}: a model of coupled axes inverts all: leave it out")
            scanner = self._scanner
            drive = scanner.invert(
                scanner.checked("desired", desired, sample_period), periodic=periodic
            )
            scanner.refuse_beyond(drive, limits or UNLIMITED)
            return drive
        self._refuse_periodic(periodic=periodic)
        self._warn_of_unknown_effects()
        target = self._trace("desired", desired, sample_period)
        self._warn_of_start(target)
        names = "a list of effects, as ['creep']"
        chosen = INVERSES if effects is None else all_of_type(str, "effects", effects, names)
        settings = InverseSettings()
        if weight is not None:
            corner = positive("weight", weight, "in Hz, as 5e3")
            settings = evolve(settings, weight=SmoothWeight(corner, RelativeWeight().order))
        inverse = Compensation(
            self.scanner,
            target.sample_period,
            chosen,
            settings,
            limits or UNLIMITED,
        )
        return self._like(desired, inverse.whole(target))

    def save(self, path: Path | str, heading: str | None = None) -> None:
        """Write the model file ``path`` and its arrays beside it, in place of what is there.

        Parameters
        ----------
        path
            The file; folders that are missing are made.
        heading
            The comment at the file's head.

        Raises
        ------
        InputError
            Where the files cannot be written.
        """
        file = path_of(path, MODEL_FILE)
        made = heading or f"A scanner's model, written by afm_scan_ros {version()}."
        if isinstance(self._scanner, ScannerModel):
            model_file.save_model(file, self._scanner, made)
        else:
            from afm_scan_ros.files import coupled_file  # noqa: PLC0415 - loads what few models need

            coupled_file.save_coupled(file, self._scanner, made)

    def _refuse_periodic(self, *, periodic: bool) -> None:
        if periodic:
            raise InputError("periodic: only a model of coupled axes predicts steady periods")

    def _warn_of_unknown_effects(self) -> None:
        for sentence in unknown_effects(self.effects):
            LOG.warning("%s", sentence)

    def _warn_of_start(self, target: Trace) -> None:
        """Say which axes do not begin at zero, but for what a preview may cut off too."""
        for name in self.axes:
            path = target.axis(name)
            if abs(path[0]) > LARGEST_TAIL * np.max(np.abs(path)):
                LOG.warning(
                    "desired %s begins at %.4g m and the scanner at zero: its first samples are not"
                    " followed, and the drive steps; begin it at zero",
                    name,
                    path[0],
                )

    def _trace(self, what: str, given: ArrayLike, sample_period: float) -> Trace:
        values = samples(what, given)
        refuse_other_count(what, values, self.axes)
        return trace_of(values, self.axes, period_of(sample_period))

    def _like(self, given: ArrayLike, trace: Trace) -> Array:
        """Return the model's axes of a run, shaped as what was given."""
        values = channels_of(trace, self.axes)
        return values[:, 0] if np.ndim(given) == 1 else values


def load_model(path: Path | str | None = None) -> Model:
    """Load a model file.

    Parameters
    ----------
    path
        The file; where None, that of the simulated scanner, ``config/model.yaml``.

    Returns
    -------
    Model
        With the covariance and the error that the file states.

    Raises
    ------
    InputError
        Where the file cannot be read; it names the file, the key and the fix.

    Examples
    --------
    >>> import afm_scan_ros as afm
    >>> afm.load_model().axes
    ('x', 'y')
    """
    file = share_directory() / "config/model.yaml" if path is None else path_of(path, MODEL_FILE)
    content = yaml.load(file)
    if isinstance(content, Mapping) and "coupled" in content:
        from afm_scan_ros.files.coupled_file import load_coupled  # noqa: PLC0415 - see save

        return Model(load_coupled(file), str(file))
    return Model(model_file.load_model(file), str(file))
