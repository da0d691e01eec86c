"""Three records of a scanner → its model and a report of how well it fits.

Creep needs neither of the others. Hysteresis needs the vibration (the record is freed of it), and
vibration the hysteresis (its input is F = H(u)), so the two take turns until they rest.
"""

import numpy as np
from attrs import frozen

from afm_scan_ros.core.effects.creep import Creep
from afm_scan_ros.core.effects.hysteresis.preisach import Preisach
from afm_scan_ros.core.effects.vibration import InverseDesign, Vibration
from afm_scan_ros.core.effects.weights import SmoothWeight
from afm_scan_ros.core.errors import ScanError
from afm_scan_ros.core.identification.creep_fit import fit_creep
from afm_scan_ros.core.identification.everett_fit import EverettFit, fit_everett
from afm_scan_ros.core.identification.fit_report import AxisReport, fresh_misfits
from afm_scan_ros.core.identification.frequency_response import (
    FrequencyResponse,
    frequency_response,
)
from afm_scan_ros.core.identification.rational_fit import fit_rational
from afm_scan_ros.core.identification.recording import Recording
from afm_scan_ros.core.identification.reversal_curves import reversal_curves
from afm_scan_ros.core.model import AxisModel, CreepModel, ScannerModel, VibrationModel
from afm_scan_ros.core.types import Array

SENSOR_SENSITIVITY = 8.0e-6
"""m per sensor volt: an assumption of this package, the paper publishes none."""
GAUGE = 1.07e14 / 1.55e14 * SENSOR_SENSITIVITY
"""G(0) in m/V, a convention: F then has the paper's volts (Eq. 5). Only F times G(0) is seen."""
HIGHEST = 800.0
"""Hz up to which the vibration is fitted: past the resonance, short of the modes beyond it."""
SLOW = SmoothWeight(corner=400.0, order=3)
"""What of the hysteresis record is believed: its ramps are slow, the sensor's noise is not."""
SETTLED = 1e-6
"""Largest change of the Everett surface from round to round, over the range of F, to stop at."""
ROUNDS = 10


@frozen(eq=False)
class AxisIdentification:
    """What was fitted to one axis, with the signals between, for report and figures."""

    model: AxisModel
    report: AxisReport
    response: FrequencyResponse
    drive: Array
    """Drive of the hysteresis record, V, shape (n,)."""
    effective: Array
    """Effective input F of that record, freed of creep and vibration, V, shape (n,)."""


@frozen(eq=False)
class Identification:
    """The identified scanner, axis by axis."""

    x: AxisIdentification
    y: AxisIdentification

    @property
    def model(self) -> ScannerModel:
        """The model of both axes."""
        return ScannerModel(x=self.x.model, y=self.y.model)


def identify(creep: Recording, frequency: Recording, hysteresis: Recording) -> Identification:
    """Identify both axes from the three records, each from its depolarised rest at zero.

    Raises InputError where a record cannot show what it is for, ScanError where hysteresis and
    vibration do not come to rest.
    """
    return Identification(
        *(
            _identify_axis(
                _AxisRecord.of(creep, axis),
                _AxisRecord.of(frequency, axis),
                _AxisRecord.of(hysteresis, axis),
            )
            for axis in ("x", "y")
        )
    )


@frozen(eq=False)
class _AxisRecord:
    drive: Array
    displacement: Array
    sample_period: float
    period: int

    @classmethod
    def of(cls, recording: Recording, axis: str) -> "_AxisRecord":
        drive, displacement = recording.drive.axis(axis), recording.displacement.axis(axis)
        return cls(drive, displacement, recording.sample_period, recording.period)

    def freed_of(self, creep: CreepModel) -> Array:
        """Displacement without its creep (Eq. 10), m."""
        inverse = Creep(creep, self.sample_period)
        return inverse.invert(inverse.inverse_at_rest(), self.displacement)[1]


def _identify_axis(
    creep: _AxisRecord, frequency: _AxisRecord, hysteresis: _AxisRecord
) -> AxisIdentification:
    creep_fit = fit_creep(creep.drive, creep.displacement, creep.sample_period)
    curves = reversal_curves(hysteresis.drive)
    slow = hysteresis.freed_of(creep_fit.model)
    fast = frequency.freed_of(creep_fit.model)
    everett = fit_everett(hysteresis.drive, slow / GAUGE, curves)
    for rounds in range(1, ROUNDS + 1):
        before = everett
        response = _response(before, frequency, fast)
        vibration = fit_rational(response, frequency.sample_period, GAUGE, HIGHEST)
        effective = _freed_of_vibration(slow, vibration.model, hysteresis.sample_period)
        everett = fit_everett(hysteresis.drive, effective, curves)
        change = _change(before, everett)
        if change <= SETTLED:
            break
    else:
        raise ScanError(
            f"hysteresis and vibration still change each other by {change:.2g} of the range after"
            f" {ROUNDS} rounds: drive the frequency record with a lower amplitude"
        )
    model = AxisModel(everett.model, vibration.model, creep_fit.model)
    exact, direct = fresh_misfits(
        everett, hysteresis.drive[curves.end :], effective[curves.end :]
    )
    report = AxisReport(
        creep=creep_fit,
        vibration=vibration,
        exact=exact,
        direct=direct,
        drive_range=float(np.ptp(hysteresis.drive)),
        effective_range=_range(everett),
        closure=everett.closure,
        rounds=rounds,
        change=change,
    )
    return AxisIdentification(model, report, response, hysteresis.drive, effective)


def _response(everett: EverettFit, frequency: _AxisRecord, output: Array) -> FrequencyResponse:
    """Response to F = H(u), the memory followed from the record's depolarised start."""
    hysteresis = Preisach(everett.model.forward)
    effective = hysteresis.apply(hysteresis.at_rest(), frequency.drive)[1]
    return frequency_response(
        frequency.drive, effective, output, frequency.period, frequency.sample_period
    )


def _freed_of_vibration(slow: Array, model: VibrationModel, sample_period: float) -> Array:
    """F held by the converter whose sampled response is ``slow``: delay and hold come off."""
    return Vibration(model, sample_period, InverseDesign(SLOW)).inverse.invert_whole(slow)


def _change(before: EverettFit, after: EverettFit) -> float:
    old, new = before.model.forward, after.model.forward
    return float(np.abs(new.values - old.values).max() / _range(after))


def _range(everett: EverettFit) -> float:
    surface = everett.model.forward
    return surface.output_upper - surface.output_lower
