"""Records of a periodic drive, cut into its periods, with the lines that were driven."""

from collections.abc import Sequence

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import Array

REPEATS = 0.01
"""Share of a drive's power by which it may differ between periods; unlike drives differ by all."""
ROUNDING = float(np.sqrt(np.finfo(float).eps))
NEAR_BEST = 10.0
"""Factor within which two shares are alike: both are the drive's noise."""
DRIVEN = 1e-4
"""Power of a line, over that of the strongest, from which it is driven: 1 % of its amplitude."""
TRANSIENT = 10.0
"""Power of the periods' difference at their beginning, over that in their second half, from which
it is a transient: noise has the same in both."""
BEGINNING = 10
"""Part of a period, one in so many, that is its beginning."""


@frozen(eq=False)
class CoupledRecord:
    """A drive (n, m) in V and the displacement (n, p) in m; ``name`` is for messages."""

    name: str
    drive: Array
    displacement: Array
    sample_period: float

    @property
    def rms(self) -> float:
        """Rms drive, of all inputs together, V."""
        return float(np.sqrt(np.mean(self.drive**2)))


@frozen(eq=False)
class Periods:
    """Records cut into periods: ``drive`` (samples, m, records, periods), ``output`` alike.

    ``used`` (samples // 2 + 1,) marks the lines that were driven.
    """

    drive: Array
    output: Array
    sample_period: float
    used: NDArray[np.bool_]


def in_periods(records: Sequence[CoupledRecord]) -> Periods:
    """Cut records into periods; each begins in steady state.

    Raises InputError where a record's drive does not repeat, its displacement has not settled, or
    the records differ in sample period, period or channels.
    """
    first, *others = records
    length = period_of_drive(first)
    for other in others:
        _refuse_unlike(first, length, other)
    count = min(len(record.drive) // length for record in records)
    for record in records:
        _refuse_unsettled(record, length)
    drive, output = (
        np.stack([_cut(getattr(record, name), length, count) for record in records], axis=2)
        for name in ("drive", "displacement")
    )
    power = np.sum(np.abs(np.fft.rfft(drive.mean(axis=3), axis=0)) ** 2, axis=(1, 2))
    power[0] = 0.0
    return Periods(drive, output, first.sample_period, power > DRIVEN * power.max())


def period_of_drive(record: CoupledRecord) -> int:
    """Return the samples after which a drive repeats; raises InputError where it does not."""
    samples = len(record.drive)
    share = _differing(record.drive)
    inner = share[1:-1]
    dips = 1 + np.flatnonzero((inner < share[:-2]) & (inner <= share[2:]))
    dips = dips[share[dips] < REPEATS]
    if not dips.size:
        raise InputError(
            f"{record.name}: its drive does not repeat within its {samples} samples: records of"
            " coupled axes need two periods or more of a multisine, in steady state"
        )
    best = max(float(share[dips].min()), ROUNDING)
    return int(dips[share[dips] <= NEAR_BEST * best][0])


def _differing(drive: Array) -> Array:
    """Share of its power by which a drive differs from itself later, (half of the samples + 2,)."""
    samples = len(drive)
    spectrum = np.fft.rfft(drive, 2 * samples, axis=0)
    alike = np.fft.irfft(np.sum(np.abs(spectrum) ** 2, axis=1), 2 * samples)
    passed = np.concatenate([[0.0], np.cumsum(np.sum(drive**2, axis=1))])
    later = np.arange(min(samples // 2 + 2, samples))
    both = passed[samples - later] + passed[-1] - passed[later]
    tiny = np.finfo(float).tiny
    return np.asarray(np.maximum(both - 2.0 * alike[later], 0.0) / np.maximum(both, tiny))


def _cut(signal: Array, length: int, periods: int) -> Array:
    """Return the last periods of a signal (n, channels): (length, channels, periods)."""
    last = signal[len(signal) - length * periods :]
    return np.moveaxis(last.reshape(periods, length, -1), 0, 2)


def _refuse_unlike(first: CoupledRecord, length: int, other: CoupledRecord) -> None:
    said = (
        ("sample period (s)", first.sample_period, other.sample_period),
        ("inputs", first.drive.shape[1], other.drive.shape[1]),
        ("outputs", first.displacement.shape[1], other.displacement.shape[1]),
        ("samples in a period", length, period_of_drive(other)),
    )
    for what, mine, its in said:
        if mine != its:
            raise InputError(
                f"{other.name}: {what}: {its:g}, and {mine:g} in {first.name}: give records that"
                " have the same"
            )


def _refuse_unsettled(record: CoupledRecord, length: int) -> None:
    """Raise InputError where the first period shows a transient that the last does not."""
    each = _cut(record.displacement, length, len(record.drive) // length)
    power = np.sum((each[:, :, 0] - each[:, :, -1]) ** 2, axis=1)
    begun, rest = power[: 1 + length // BEGINNING].mean(), power[length // 2 :].mean()
    if begun > TRANSIENT * rest:
        raise InputError(
            f"{record.name}: its first period begins with a transient: cut that period off, or"
            " record until the scanner has settled and then two periods"
        )
