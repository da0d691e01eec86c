"""Which operator the hysteresis of an axis is: Preisach's between maps, or Duhem's.

Both are fitted to the reversal curves. The whole model with either predicts the displacement of
what fitted nothing: the loops after the curves, else the record for validation. Duhem's is chosen
where it is better by the test of ``is_better``.
"""

import numpy as np
from attrs import evolve, frozen

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.alternating import AxisRecord, Converged, with_duhem
from afm_scan_ros.core.identification.hysteresis.duhem_fit import fit_duhem
from afm_scan_ros.core.identification.hysteresis.fresh_loops import is_better
from afm_scan_ros.core.identification.records.matches import loops_after
from afm_scan_ros.core.identification.records.recording import Misfit, misfit
from afm_scan_ros.core.model import AxisModel, CreepModel
from afm_scan_ros.core.scanner import forward
from afm_scan_ros.core.types import Array

PREISACH, DUHEM = "preisach", "duhem"


@frozen
class OperatorChoice:
    """Residual (m) of the model with either operator on a held-out ``record``."""

    record: str
    preisach: Misfit
    duhem: Misfit
    chosen: str


def choose_operator(
    converged: Converged, creep: CreepModel, hysteresis: AxisRecord, validation: AxisRecord | None
) -> tuple[Converged, OperatorChoice | None]:
    """Return what settles with the better operator; without held-out data Preisach's stays.

    Raises ScanError where Duhem's is better and does not settle with the vibration.
    """
    curves = converged.turns.curves
    name, record, first = "hysteresis, the loops after its curves", hysteresis, curves.end
    if not loops_after(hysteresis, curves):
        if validation is None:
            return converged, None
        name, record, first = "validation", validation, 0
    drive, effective = hysteresis.drive[: curves.end], converged.turn.effective[: curves.end]
    try:
        slopes = fit_duhem(drive, effective)
    except (InputError, np.linalg.LinAlgError):  # there is no hysteresis, or too few branches
        return converged, None
    tried = evolve(converged, slopes=slopes)
    preisach, duhem = (_left(each, creep, record)[first:] for each in (converged, tried))
    better = is_better(duhem, preisach, record.drive[first:])
    chosen = DUHEM if better else PREISACH
    choice = OperatorChoice(name, misfit(preisach), misfit(duhem), chosen)
    return (with_duhem(converged, slopes) if better else converged), choice


def _left(converged: Converged, creep: CreepModel, record: AxisRecord) -> Array:
    """Displacement (m) of a record less that predicted from depolarised rest, (n,)."""
    model = AxisModel(converged.hysteresis, converged.turn.vibration.model, creep)
    cascade = forward(model, record.sample_period)
    return np.asarray(record.displacement - cascade.apply(cascade.at_rest(), record.drive)[1])
