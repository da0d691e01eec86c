"""One scan made twice, with a model's inverse and with that of its extension."""

from collections.abc import Mapping

from attrs import field, frozen

from afm_scan_ros.core.closed_loop.own import left_of, told_by
from afm_scan_ros.core.diagnosis.floor import floor_of
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.metrics import Figure, Tracking
from afm_scan_ros.core.metrics.figures import METRES
from afm_scan_ros.core.model import ScannerModel
from afm_scan_ros.core.scan import Scan
from afm_scan_ros.core.types import AXES

MATTERS = 0.05
"""Share by which an error must change to be called better or worse."""


@frozen
class Residual:
    """Rms of measured minus predicted displacement, its mean left out: of a scan no fit saw.

    ``before`` is what the model leaves of it, ``after`` what its extension does, ``floor`` what
    is no effect. Only what is each record's own, as a disturbance's phase, is fitted to it.
    """

    floor: float = field(metadata=METRES)
    before: float = field(metadata=METRES)
    after: float = field(metadata=METRES)


@frozen(eq=False)
class Trial:
    """How well the scanner followed before and after, and what the models leave of ``after``."""

    measured_before: Tracking
    measured_after: Tracking
    true_before: Tracking
    true_after: Tracking
    residual: Mapping[str, Residual]

    @property
    def change(self) -> dict[str, float]:
        """Error after over error before, of each axis: measured, rms of all samples."""
        return {
            name: rms_of(self.measured_after, name) / rms_of(self.measured_before, name)
            for name in AXES
        }

    @property
    def worse(self) -> dict[str, float]:
        """The axes whose error grew by more than ``MATTERS``, and how many times."""
        return {name: ratio for name, ratio in self.change.items() if ratio > 1.0 + MATTERS}

    @property
    def better(self) -> bool:
        """Whether the error of an axis fell by more than ``MATTERS``."""
        return min(self.change.values()) < 1.0 - MATTERS


def rms_of(tracking: Tracking, axis: str) -> float:
    """Rms error of one axis in m, over all lines but the first."""
    figure: Figure | None = getattr(tracking, axis).all
    if figure is None:
        raise InputError("the scan has no line after its first: give it more lines")
    return figure.rms


def trial_of(model: ScannerModel, extended: ScannerModel, before: Scan, after: Scan) -> Trial:
    """Compare a scan with the model's inverse with the same scan with its extension's."""
    return Trial(
        measured_before=before.tracking("measured"),
        measured_after=after.tracking("measured"),
        true_before=before.tracking("true"),
        true_after=after.tracking("true"),
        residual=_residuals(model, extended, after),
    )


def _residuals(model: ScannerModel, extended: ScannerModel, scan: Scan) -> dict[str, Residual]:
    models = (told_by(model, scan), told_by(extended, scan))
    return {
        name: Residual(
            _floor(model, scan, name), *(float(left_of(m, scan, name).std()) for m in models)
        )
        for name in AXES
    }


def _floor(model: ScannerModel, scan: Scan, axis: str) -> float:
    known = model.axis(axis).known_errors
    if not known:
        raise InputError(
            f"the model of axis {axis} states no known_error: identify it anew, with its"
            " validation record"
        )
    return floor_of(known, scan.measured.axis(axis), scan.spec.sample_period).total
