"""Records of coupled axes for a diagnosis: those that show what is wrong, and those that do not.

The last record of each amplitude is held out of every fit.
"""

from collections.abc import Sequence

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from afm_scan_ros.core.coupled_scanner import CoupledScanner
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.state_space.identify import (
    Teaching,
    levels_of,
    refuse_few,
)
from afm_scan_ros.core.identification.state_space.spectra import CoupledRecord, Periods, in_periods

Levels = list[list[int]]


@frozen(eq=False)
class DiagnosedRecords:
    """Periods of all records, and the places of those of each amplitude.

    ``known`` are amplitudes at which the model holds, by records or else by its own word.
    """

    periods: Periods
    known: Levels
    diagnosed: Levels
    recorded: bool

    @property
    def held_out(self) -> list[int]:
        """Places of the held-out records, those of known amplitudes first if they are recorded."""
        return [level[-1] for level in (*(self.known if self.recorded else ()), *self.diagnosed)]

    @property
    def healthy(self) -> NDArray[np.bool_]:
        """Whether the model holds for each held-out record."""
        count = len(self.known) if self.recorded else 0
        return np.arange(len(self.held_out)) < count

    def teaching(self, *, changed: bool) -> Teaching:
        """Records to fit; none of a known amplitude where the structure has ``changed`` since."""
        levels = self.diagnosed if changed else [*self.known, *self.diagnosed]
        return Teaching.of(self.periods, [level[:-1] for level in levels])


def diagnosed_records(
    scanner: CoupledScanner, records: Sequence[CoupledRecord], healthy: Sequence[CoupledRecord]
) -> DiagnosedRecords:
    """Cut records into periods, and group them by amplitude.

    Raises InputError where a record is not in steady state or not of the model's kind, is given
    twice, or an amplitude has no more records than the model has drives.
    """
    for record in (*records, *healthy):
        _refuse_other(scanner, record)
    _refuse_twice([*records, *healthy])
    known = list(healthy) or _own_word(scanner, records)
    groups = levels_of(known), levels_of(records)
    for given, levels in zip((known, records), groups, strict=True):
        refuse_few(given, levels, len(scanner.axes))
    later = [[len(known) + k for k in level] for level in groups[1]]
    return DiagnosedRecords(in_periods([*known, *records]), groups[0], later, bool(healthy))


def _own_word(scanner: CoupledScanner, records: Sequence[CoupledRecord]) -> list[CoupledRecord]:
    """What the model says at each amplitude of its own, of the first drives made as small."""
    periods, first = in_periods(records), levels_of(records)[0]
    drives = periods.drive[:, :, first].mean(axis=3)
    size = np.sqrt(np.mean(drives**2))
    found = []
    for error in scanner.errors:
        smaller = drives * (error.drive_rms / size)
        moved = scanner.model.steady_state(smaller)
        for drive, output in zip(*(np.moveaxis(s, 2, 0) for s in (smaller, moved)), strict=True):
            driven, followed = (np.tile(signal, (2, 1)) for signal in (drive, output))
            found.append(CoupledRecord("the model", driven, followed, scanner.sample_period))
    return found


def _refuse_other(scanner: CoupledScanner, record: CoupledRecord) -> None:
    period = scanner.sample_period
    if not np.isclose(record.sample_period, period, rtol=1e-9, atol=0.0):
        raise InputError(
            f"{record.name}: its sample period is {record.sample_period:.9g} s, and that of the"
            f" model {period:.9g} s: resample the record"
        )


def _refuse_twice(records: Sequence[CoupledRecord]) -> None:
    for place, record in enumerate(records):
        for other in records[:place]:
            if np.array_equal(record.displacement, other.displacement):
                raise InputError(
                    f"{record.name}: holds the same as {other.name}, which would count twice: give"
                    " one of them"
                )
