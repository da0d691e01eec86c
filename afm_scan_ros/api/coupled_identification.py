"""A model of coupled axes from records."""

from collections.abc import Iterable, Sequence

from afm_scan_ros.api.model import Model
from afm_scan_ros.api.record import Record
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.state_space.identify import (
    CoupledSetting,
    coupling_is_seen,
    identify_coupled,
)
from afm_scan_ros.core.identification.state_space.spectra import CoupledRecord
from afm_scan_ros.core.types import ProgressCallback


def of_coupled_axes(records: Sequence[Record]) -> bool:
    """Whether all records drive the same two axes or more at once, and the axes are coupled."""
    axes = {record.axes for record in records}
    if len(axes) > 1 or len(records[0].axes) == 1 or any(record.kind for record in records):
        return False
    return coupling_is_seen(coupled_records(records))


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
    given = coupled_records(records)
    setting = CoupledSetting(tuple(effects), states)
    scanner = identify_coupled(given, first.axes, setting, progress)
    return Model(scanner, f"identified from {', '.join(one.name for one in given)}")


def coupled_records(records: Sequence[Record]) -> list[CoupledRecord]:
    """Records as the core takes them; one without a name gets a number."""
    return [
        CoupledRecord(
            record.name or f"record {number}",
            record.drive,
            record.displacement,
            record.sample_period,
        )
        for number, record in enumerate(records, start=1)
    ]
