"""Records of coupled axes for a diagnosis, and the likelihood of what a model leaves of them.

The last record of each amplitude is held out of every fit.

In a part of the band, of width W, an output of a structure of the decay time T has W T independent
complex amplitudes for each of m drives. So the residual has n = 2 m max(1, W T) amplitudes there.
The model's error was stated from a record of such a drive, so its variance is known from as many.
"""

from collections.abc import Sequence
from functools import cached_property

import numpy as np
import scipy
from attrs import frozen
from numpy.typing import NDArray
from scipy.stats import combine_pvalues

from afm_scan_ros.core.coupled_scanner import CoupledScanner, LevelError
from afm_scan_ros.core.diagnosis.likelihood import CellFit
from afm_scan_ros.core.diagnosis.settings import LIKELIHOOD
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.state_space.feedback import FeedbackModel
from afm_scan_ros.core.identification.state_space.identify import (
    Teaching,
    levels_of,
    refuse_few,
)
from afm_scan_ros.core.identification.state_space.spectra import (
    DRIVEN,
    Periods,
    in_periods,
    power_by_band,
)
from afm_scan_ros.core.record import Record
from afm_scan_ros.core.types import Array

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
    scanner: CoupledScanner, records: Sequence[Record], healthy: Sequence[Record]
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


def _own_word(scanner: CoupledScanner, records: Sequence[Record]) -> list[Record]:
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
            found.append(
                Record(driven, followed, scanner.sample_period, scanner.axes, name="the model")
            )
    return found


def _refuse_other(scanner: CoupledScanner, record: Record) -> None:
    period = scanner.sample_period
    if not np.isclose(record.sample_period, period, rtol=1e-9, atol=0.0):
        raise InputError(
            f"{record.name}: its sample period is {record.sample_period:.9g} s, and that of the"
            f" model {period:.9g} s: resample the record"
        )


def _refuse_twice(records: Sequence[Record]) -> None:
    for place, record in enumerate(records):
        for other in records[:place]:
            if np.array_equal(record.displacement, other.displacement):
                raise InputError(
                    f"{record.name}: holds the same as {other.name}, which would count twice: give"
                    " one of them"
                )


@frozen(eq=False, slots=False)
class HeldOutLikelihood:
    """Held-out records: ``drive`` (samples, m, records), V, ``output`` (samples, p, records), m.

    ``noise`` (parts, p, records) is its mean square in parts of the band, m². The model holds for
    ``healthy`` (records,).
    """

    scanner: CoupledScanner
    drive: Array
    output: Array
    noise: Array
    healthy: NDArray[np.bool_]

    @classmethod
    def of(cls, scanner: CoupledScanner, records: DiagnosedRecords) -> "HeldOutLikelihood":
        """Return that of some records; noise is what differs between the periods of each."""
        periods, chosen = records.periods, records.held_out
        drive, output = (signal[:, :, chosen] for signal in (periods.drive, periods.output))
        apart = power_by_band(output - output.mean(axis=3, keepdims=True), *_parts(scanner))
        count = output.shape[3]
        noise = apart.sum(axis=3) / (count * (count - 1))
        return cls(scanner, drive.mean(axis=3), output.mean(axis=3), noise, records.healthy)

    @cached_property
    def base(self) -> Array:
        """Output (samples, p, records) that the model predicts, m."""
        return self.scanner.model.steady_state(self.drive)

    def simulated(self, model: FeedbackModel, *, changed: bool) -> Array:
        """Output of another model; of a ``changed`` one not for records of the healthy scanner.

        Raises ScanError where the simulation does not settle.
        """
        output = self.base.copy()
        later = ~self.healthy if changed else np.ones_like(self.healthy)
        output[:, :, later] = model.steady_state(self.drive[:, :, later])
        return output

    def fit(self, simulated: Array, *, exact: bool = False) -> CellFit:
        """Fit of an output (samples, p, records), over all parts of the band that are driven.

        It has no formula that may be inexact where it is ``exact``, as a linear structure is.
        """
        power, added = (self._power(of - simulated) for of in (self.output, self.base))
        added = np.zeros_like(added) if exact else added
        count = np.full(len(power), self.amplitudes)
        return CellFit.of(power, added, self.variance, count, count)

    def explains(self, bands: CellFit) -> bool:
        """Whether a fit lacks nothing: in no cell, and not in all together by Fisher's method.

        All together are those of the records that are diagnosed. The error is stated for all
        outputs and amplitudes together, so they share a test in each part of the band.
        """
        ratio, cells = np.zeros(self._driven.shape), self._driven[:, :, ~self.healthy]
        ratio[self._driven] = bands.power / bands.variance
        cells = cells.sum(axis=(1, 2))
        parts, count = cells > 0, self.amplitudes
        mean = ratio[:, :, ~self.healthy].sum(axis=(1, 2))[parts] / cells[parts]
        tails = scipy.stats.f.sf(mean, count * cells[parts], count)
        return bands.adequate and bool(combine_pvalues(tails).pvalue >= LIKELIHOOD.false_lack)

    def outside(self) -> float:
        """Log evidence (nats) of something that no effect describes."""
        return self.fit(self.base).outside(self._power(self.output))

    @cached_property
    def variance(self) -> Array:
        """Variance (cells,) in m² of noise and model discrepancy."""
        shares = [_nearest(self.scanner, drive).by_band for drive in np.moveaxis(self.drive, 2, 0)]
        moved = power_by_band(self.output, *_parts(self.scanner))
        return np.asarray((self.noise + np.square(shares).T[:, np.newaxis] * moved)[self._driven])

    def limits(self) -> Array:
        """Detection limit (p,) of each output, rms over its records, m."""
        whole = np.zeros(self.noise.shape)
        whole[self._driven] = self.variance
        return np.asarray(np.sqrt(whole[:, :, ~self.healthy].sum(axis=0).mean(axis=1)))

    def rms(self, simulated: Array) -> Array:
        """Rms residual (p,) of each output over the records that are diagnosed, m."""
        left = power_by_band(self.output - simulated, *_parts(self.scanner))
        return np.asarray(np.sqrt(left[:, :, ~self.healthy].sum(axis=0).mean(axis=1)))

    @cached_property
    def _driven(self) -> NDArray[np.bool_]:
        power = power_by_band(self.drive, *_parts(self.scanner)).sum(axis=1, keepdims=True)
        return np.broadcast_to(power > DRIVEN * power.max(axis=0), self.noise.shape)

    @property
    def amplitudes(self) -> float:
        """Independent amplitudes of a cell, n."""
        (low, high), parts, _ = _parts(self.scanner)
        resolved = (high - low) / parts * self.scanner.actuators.decay_time
        return 2.0 * len(self.scanner.axes) * max(1.0, resolved)

    def _power(self, signal: Array) -> Array:
        return np.asarray(power_by_band(signal, *_parts(self.scanner))[self._driven])


def _parts(scanner: CoupledScanner) -> tuple[tuple[float, float], int, float]:
    return scanner.band, len(scanner.errors[0].by_band), scanner.sample_period


def _nearest(scanner: CoupledScanner, drive: Array) -> LevelError:
    """Error stated at the amplitude that is nearest to a drive's (samples, m)."""
    rms = float(np.sqrt(np.mean(drive**2)))
    return min(scanner.errors, key=lambda error: abs(np.log(error.drive_rms / rms)))
