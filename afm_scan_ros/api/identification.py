"""A model from records."""

from collections.abc import Iterable, Sequence

from afm_scan_ros.api.coupled_identification import identify_coupled_axes
from afm_scan_ros.api.model import Model
from afm_scan_ros.api.record import Record
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.alternating import Sizes
from afm_scan_ros.core.identification.drives.excitation import PLANS
from afm_scan_ros.core.identification.drives.experiments import SWEEPS
from afm_scan_ros.core.identification.hysteresis.everett_fit import LEVELS
from afm_scan_ros.core.identification.identify import identify as identify_scanner
from afm_scan_ros.core.identification.records.kinds import recognised
from afm_scan_ros.core.identification.records.recording import CalibrationRecord
from afm_scan_ros.core.identification.vibration.rational_fit import Order
from afm_scan_ros.core.types import AXES, ProgressCallback

REQUIRED = ("creep", "frequency", "hysteresis")


def identify(
    records: Iterable[Record],
    progress: ProgressCallback | None = None,
    *,
    levels: int = LEVELS,
    order: tuple[int, int] | None = None,
    delay: bool = False,
    effects: Iterable[str] = (),
    states: int | None = None,
) -> Model:
    """Identify the axes that all records hold; each record begins depolarised, at rest at zero.

    Records of more than two axes are of coupled ones: of a multisine that drives all of them, each
    of another realisation, in steady state for two periods or more.

    Arguments:
        records: one of the kind "creep", one "frequency" (multisines or a sweep), one
            "hysteresis", and, for the model discrepancy, one "validation". The first three are
            recognised from their drives where no kind is stated.
        progress: is called with what is being fitted.
        levels: of the Everett surfaces along either side, 3 or more.
        order: poles and zeros of the vibration model; None lets the record choose.
        delay: whether the vibration takes the record's delay for its own.
        effects: of coupled axes, what acts in their feedback, of "amplitude_softening" and
            "maxwell_slip": identified with the vibration, best from records of several amplitudes.
        states: of the vibration of coupled axes; None chooses them by records held out.

    Raises InputError where a record is missing, or cannot show what it is for, ScanError where the
    fits of hysteresis and vibration do not converge.

    >>> import numpy as np
    >>> import afm_scan_ros as afm
    >>> steps = np.repeat([0.0, 0.5, 1.0, 0.0], 2000)
    >>> record = afm.Record(steps, 5e-6 * steps, sample_period=0.01)
    >>> afm.identify([record])
    Traceback (most recent call last):
    ...
    afm_scan_ros.core.errors.InputError: no frequency record is given, no hysteresis record is \
given: an identification needs one each of creep, frequency, hysteresis
    """
    given, said = list(records), progress or (lambda _: None)
    if any(len(record.axes) > len(AXES) for record in given):
        return identify_coupled_axes(given, effects, states, said)
    if effects or states:
        raise InputError("effects and states are of coupled axes: give records of three or more")
    found = _by_kind(given)
    recordings = {kind: _recording(kind, record) for kind, record in found.items()}
    sizes = Sizes(levels, None if order is None else Order(*order), delay)
    identified = identify_scanner(**recordings, sizes=sizes, progress=said)
    names = ", ".join(recording.name for recording in recordings.values())
    return Model(identified.model, f"identified from {names}", identified)


def _by_kind(records: Sequence[Record]) -> dict[str, Record]:
    """Records by what each is for; raises InputError for one too few, too many, or of no use."""
    found: dict[str, Record] = {}
    for number, record in enumerate(records, start=1):
        where = record.name or f"record {number}"
        kind = "frequency" if record.kind in SWEEPS else record.kind or _recognised(record, where)
        if kind not in PLANS:
            raise InputError(f"{where} is of the kind '{kind}': give some of {', '.join(PLANS)}")
        if kind in found:
            raise InputError(f"{where} is another {kind} record: give one of each kind")
        found[kind] = record
    missing = [f"no {kind} record is given" for kind in REQUIRED if kind not in found]
    if missing:
        raise InputError(
            f"{', '.join(missing)}: an identification needs one each of {', '.join(REQUIRED)}"
        )
    return found


def _recognised(record: Record, where: str) -> str:
    kinds = {recognised(record.drive[:, i]) for i in range(len(record.axes))}
    kind = kinds.pop() if len(kinds) == 1 else None
    if kind is None:
        raise InputError(
            f"{where}: its drive does not tell what kind of record it is: state kind, one of"
            f" {', '.join(PLANS)}"
        )
    return kind


def _recording(kind: str, record: Record) -> CalibrationRecord:
    """Check a record for what it is to be used for."""
    if record.missing:
        raise InputError("; ".join((*record.shortcomings, "record it again")))
    name = f"{kind} in {record.name}" if record.name else kind
    axes = tuple(axis for axis in AXES if axis in record.axes)
    return CalibrationRecord(name, *record.traces(), axes)
