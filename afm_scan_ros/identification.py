"""A model from records, of one axis or two, or of coupled axes."""

from collections.abc import Iterable, Sequence

from attrs import evolve

from afm_scan_ros.core.arguments import RECORDS, all_of_type, whole
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.identify import identify_records
from afm_scan_ros.core.identification.state_space.identify import (
    CoupledSetting,
    coupling_is_seen,
    identify_coupled,
)
from afm_scan_ros.core.record import Record
from afm_scan_ros.core.types import AXES, ProgressCallback
from afm_scan_ros.model import Model


def of_coupled_axes(records: Sequence[Record]) -> bool:
    """Whether all records drive the same two axes or more at once, and the axes are coupled."""
    axes = {record.axes for record in records}
    if len(axes) > 1 or len(records[0].axes) == 1 or any(record.kind for record in records):
        return False
    return coupling_is_seen(named(records))


def identify_coupled_axes(
    records: Sequence[Record],
    effects: Iterable[str],
    states: int | None,
    progress: ProgressCallback,
) -> Model:
    """Identify records that are all of the same axes; see ``identify``."""
    first, *others = records
    for other in others:
        if other.axes != first.axes:
            raise InputError(
                f"{other.name}: its axes are {', '.join(other.axes)}, and {', '.join(first.axes)}"
                f" in {first.name}: give records of the same coupled axes"
            )
    given = named(records)
    for record in given:
        record.warn()
    setting = CoupledSetting(tuple(effects), states)
    scanner = identify_coupled(given, first.axes, setting, progress)
    return Model(scanner, f"identified from {', '.join(one.name for one in given)}")


def named(records: Iterable[Record], kind: str = "record") -> list[Record]:
    """Return records of which those without a name have got their number for one."""
    return [
        record if record.name else evolve(record, name=f"{kind} {number}")
        for number, record in enumerate(records, start=1)
    ]


def identify(
    records: Iterable[Record],
    progress: ProgressCallback | None = None,
    *,
    effects: Iterable[str] = (),
    states: int | None = None,
    linear: bool = False,
) -> Model:
    """Identify every axis from whatever records there are of it, of any number and kinds.

    Parameters
    ----------
    records
        None needs a kind. Those of the kind "validation" fit nothing: the model's error is measured
        on them, and ``diagnose`` needs that error.
    progress
        Is called with what is being fitted: text that also has how many axes are ``done`` of a
        ``total``. ``timed(print)`` shows it with the time.
    effects
        Of coupled axes, what acts in their feedback, of "amplitude_softening" and "maxwell_slip":
        identified with the vibration, best from records of several amplitudes.
    states
        Number of states of the vibration of coupled axes; None chooses it by records held out.
    linear
        Whether the scanner has no hysteresis, as one of flexures that a voice coil or an
        electrostatic comb drives: its vibration and creep alone are fitted.

    Returns
    -------
    Model
        ``Model.effects`` states what the records identify; all else is unknown, and is in the model
        as it was expected before the records were taken.

    Raises
    ------
    InputError
        Where a record shows nothing or is of another scanner than the others, and for arguments out
        of range.
    ScanError
        Where a fit diverges.

    Notes
    -----
    All records of an axis are fitted at once, whatever their kinds and their order.

    Records of more than two axes are of coupled ones: of a multisine that drives all of them, each
    of another realisation, in steady state for two periods or more. So are such records of two
    axes, where they show that one drive moves both.

    Examples
    --------
    >>> import numpy as np
    >>> from scipy.signal import lfilter
    >>> import afm_scan_ros as afm
    >>> steps, kept = np.repeat([0.0, 0.5, 1.0, 0.0], 2000), np.exp(-0.01 / 5.0)
    >>> creep = 0.1 * lfilter([0.0, 1.0 - kept], [1.0, -kept], steps)
    >>> moved = 5e-6 * (steps + creep) + np.random.default_rng(1).normal(0.0, 1e-9, len(steps))
    >>> model = afm.identify([afm.Record(steps, moved, sample_period=0.01)])
    >>> {name: status.status.value for name, status in model.effects["x"].each()}
    {'creep': 'identified', 'hysteresis': 'unknown', 'vibration': 'unknown'}
    """
    given = list(all_of_type(Record, "records", records, RECORDS))
    effects = all_of_type(str, "effects", effects, "names of effects, as ['maxwell_slip']")
    states = None if states is None else whole("states", states, 2)
    report = progress or (lambda _: None)
    if not given:
        raise InputError("no record is given: give one at least")
    several = any(len(record.axes) > len(AXES) for record in given)
    if several or effects or states is not None or of_coupled_axes(given):
        return identify_coupled_axes(given, effects, states, report)
    taken = [_whole(record) for record in named(given)]
    found = identify_records(taken, report, linear=linear)
    names = ", ".join(each.name for each in taken)
    return Model(found.model, f"identified from {names}", found)


def _whole(record: Record) -> Record:
    """Return a record, its shortcomings logged; raises InputError for a part."""
    if record.missing:
        raise InputError("; ".join((*record.shortcomings, "record it again")))
    record.warn()
    return record
