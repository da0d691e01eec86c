"""Three records of a scanner → its model and a report of how well it fits.

Creep needs neither of the others: the drive rests while it is seen. Hysteresis and vibration are
then identified in turns.
"""

import numpy as np
from attrs import frozen

from afm_scan_ros.core.identification.creep_fit import fit_creep
from afm_scan_ros.core.identification.fit_report import AxisReport, fresh_misfits
from afm_scan_ros.core.identification.frequency_response import FrequencyResponse
from afm_scan_ros.core.identification.recording import Recording
from afm_scan_ros.core.identification.reversal_curves import reversal_curves
from afm_scan_ros.core.identification.turns import AxisRecord, take_turns
from afm_scan_ros.core.model import AxisModel, ScannerModel
from afm_scan_ros.core.types import Array


@frozen(eq=False)
class AxisIdentification:
    """What was fitted to one axis, with the signals between, for report and figures.

    ``drive`` and ``effective``, both (n,) in V, are u and F of the hysteresis record.
    """

    model: AxisModel
    report: AxisReport
    response: FrequencyResponse
    drive: Array
    effective: Array


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
    vibration do not settle.
    """
    records = (creep, frequency, hysteresis)
    x, y = (_identify_axis(*(AxisRecord.of(r, axis) for r in records)) for axis in ("x", "y"))
    return Identification(x, y)


def _identify_axis(
    creep: AxisRecord, frequency: AxisRecord, hysteresis: AxisRecord
) -> AxisIdentification:
    slow = fit_creep(creep.drive, creep.displacement, creep.sample_period)
    curves = reversal_curves(hysteresis.drive)
    settled = take_turns(hysteresis.freed_of(slow.model), frequency.freed_of(slow.model), curves)
    everett, drive, effective = settled.everett, hysteresis.drive, settled.effective
    exact, direct = fresh_misfits(everett, drive[curves.end :], effective[curves.end :])
    report = AxisReport(
        creep=slow,
        vibration=settled.vibration,
        exact=exact,
        direct=direct,
        drive_range=float(np.ptp(drive)),
        effective_range=everett.effective_range,
        closure=everett.closure,
        rounds=settled.rounds,
        change=settled.change,
    )
    model = AxisModel(everett.model, settled.vibration.model, slow.model)
    return AxisIdentification(model, report, settled.response, drive, effective)
