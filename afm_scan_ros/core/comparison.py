"""Compares one scan made twice: with a model's inverse, and with that of its extension.

Parameters that differ in every record, such as a disturbance's phase, are fitted to the scan.
"""

from collections.abc import Mapping

import numpy as np
from attrs import evolve, field, frozen
from scipy.optimize import least_squares

from afm_scan_ros.core.arguments import require_converged
from afm_scan_ros.core.diagnosis.discrepancy import detection_limit
from afm_scan_ros.core.effects.registry import effect_type
from afm_scan_ros.core.effects.scale import resonance_of
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.metrics import METRES, Figure, Scan, Tracking
from afm_scan_ros.core.model import Added, ScannerModel
from afm_scan_ros.core.scanner import predict
from afm_scan_ros.core.types import AXES, Array

NANOMETRES_PER_METRE = 1e9  # so that the solver's tolerances mean something
Places = list[tuple[int, int]]
"""Number of the effect on its axis, and of the parameter in it."""


def residual_of(model: ScannerModel, scan: Scan, axis: str) -> Array:
    """Measured minus predicted displacement (n,) in m of one axis, its mean left out."""
    residual = scan.measured.axis(axis) - predict(model, scan.drive).axis(axis)
    return np.asarray(residual - residual.mean())


def with_own_parameters(model: ScannerModel, scan: Scan) -> ScannerModel:
    """Return the model with the parameters that differ in every record fitted to a scan."""
    for axis in AXES:
        if places := _own(model, axis):
            model = _fitted(model, scan, axis, places)
    return model


def _fitted(model: ScannerModel, scan: Scan, axis: str, places: Places) -> ScannerModel:
    def residual(values: Array) -> Array:
        return NANOMETRES_PER_METRE * residual_of(
            _with(model, axis, places, values / NANOMETRES_PER_METRE), scan, axis
        )

    start = [NANOMETRES_PER_METRE * model.axis(axis).added[i].values[j] for i, j in places]
    fitted = require_converged(
        least_squares(residual, start), f"{axis}: what differs from scan to scan"
    )
    return _with(model, axis, places, fitted / NANOMETRES_PER_METRE)


def _own(model: ScannerModel, axis: str) -> Places:
    """Effect and parameter of each that is a record's own."""
    return [
        (i, j)
        for i, added in enumerate(model.axis(axis).added)
        for j, parameter in enumerate(effect_type(added.name).form(added.kind).parameters)
        if parameter.own
    ]


def _with(model: ScannerModel, axis: str, places: Places, values: Array) -> ScannerModel:
    new = [list(added.values) for added in model.axis(axis).added]
    for (i, j), value in zip(places, values, strict=True):
        new[i][j] = float(value)
    olds = model.axis(axis).added
    added = tuple(Added(o.name, o.kind, tuple(v)) for o, v in zip(olds, new, strict=True))
    return evolve(model, **{axis: evolve(model.axis(axis), added=added)})


RELEVANT_CHANGE = 0.05
"""Share by which an error must change to be called better or worse."""


@frozen
class Residual:
    """Rms (m) of measured minus predicted displacement, mean removed, of a scan that no fit saw.

    ``before`` is of the model, ``after`` of its extension, and ``floor`` is the detection limit.
    """

    floor: float = field(metadata=METRES)
    before: float = field(metadata=METRES)
    after: float = field(metadata=METRES)


@frozen(eq=False)
class ScanComparison:
    """Tracking errors, the true ones where known, and both models' residuals on the scan after."""

    measured_before: Tracking
    measured_after: Tracking
    true_before: Tracking | None
    true_after: Tracking | None
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
        """The axes whose error grew by more than ``RELEVANT_CHANGE``, and how many times."""
        return {name: ratio for name, ratio in self.change.items() if ratio > 1.0 + RELEVANT_CHANGE}

    @property
    def better(self) -> bool:
        """Whether the error of an axis fell by more than ``RELEVANT_CHANGE``."""
        return min(self.change.values()) < 1.0 - RELEVANT_CHANGE


def rms_of(tracking: Tracking, axis: str) -> float:
    """Rms error of one axis in m, over all lines but the first."""
    figure: Figure | None = getattr(tracking, axis).all
    if figure is None:
        raise InputError("the scan has no line after its first: give it more lines")
    return figure.rms


def compare_scans(
    model: ScannerModel, extended: ScannerModel, before: Scan, after: Scan
) -> ScanComparison:
    """Compare a scan with the model's inverse with the same scan with its extension's."""
    return ScanComparison(
        measured_before=before.tracking("measured"),
        measured_after=after.tracking("measured"),
        true_before=before.tracking("true") if before.knows_true else None,
        true_after=after.tracking("true") if after.knows_true else None,
        residual=_residuals(model, extended, after),
    )


def _residuals(model: ScannerModel, extended: ScannerModel, scan: Scan) -> dict[str, Residual]:
    models = (with_own_parameters(model, scan), with_own_parameters(extended, scan))
    return {
        name: Residual(
            _limit(model, scan, name), *(float(residual_of(m, scan, name).std()) for m in models)
        )
        for name in AXES
    }


def _limit(model: ScannerModel, scan: Scan, axis: str) -> float:
    known = model.axis(axis).model_discrepancies
    if not known:
        raise InputError(
            f"the model of axis {axis} states no model_discrepancy: identify it anew, with its"
            " validation record"
        )
    resonance = resonance_of(model.axis(axis).vibration, scan.spec.sample_period)
    moved = scan.measured.axis(axis)
    spread = model.axis(axis).spread
    return detection_limit(known, moved, scan.spec.sample_period, resonance, spread).total
