"""Records of a periodic drive → periods, spectra, the response matrix, noise and nonlinearity.

Record: one realisation of the drive, of one period or averaged over several. What differs from
period to period is noise; what differs from realisation to realisation of a random-phase
multisine, beyond the noise, is the nonlinearity's share (Pintelon and Schoukens, System
Identification, 2nd edition, 2012, chapters 4 and 7).
"""

from collections.abc import Iterable, Sequence

import numpy as np
import scipy
from attrs import evolve, frozen
from numpy.typing import NDArray

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.record import Record
from afm_scan_ros.core.types import Array, Complex

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


def drive_rms(record: Record) -> float:
    """Return the rms drive of a record, of all inputs together, V."""
    return float(np.sqrt(np.mean(record.drive**2)))


@frozen(eq=False)
class Periods:
    """Records cut into periods: ``drive`` (samples, m, records, periods), ``output`` alike.

    ``used`` (samples // 2 + 1,) marks the lines that were driven.
    """

    drive: Array
    output: Array
    sample_period: float
    used: NDArray[np.bool_]

    def of(self, level: Sequence[int]) -> "Periods":
        """Return some of the records."""
        return evolve(self, drive=self.drive[:, :, level], output=self.output[:, :, level])

    @property
    def mean(self) -> tuple[Array, Array]:
        """Drive and output (samples, ·, records) averaged over the periods."""
        return self.drive.mean(axis=3), self.output.mean(axis=3)


def in_periods(records: Sequence[Record]) -> Periods:
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


def period_of_drive(record: Record) -> int:
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


def _refuse_unlike(first: Record, length: int, other: Record) -> None:
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


def _refuse_unsettled(record: Record, length: int) -> None:
    """Raise InputError where the first period shows a transient that the last does not."""
    each = _cut(record.displacement, length, len(record.drive) // length)
    power = np.sum((each[:, :, 0] - each[:, :, -1]) ** 2, axis=1)
    begun, rest = power[: 1 + length // BEGINNING].mean(), power[length // 2 :].mean()
    if begun > TRANSIENT * rest:
        raise InputError(
            f"{record.name}: its first period begins with a transient: cut that period off, or"
            " record until the scanner has settled and then two periods"
        )


NEIGHBOURS = 41
"""Lines over which a variance is averaged: that of one line is known to a factor only."""
SCATTER_FLOOR = 0.1
"""Least share of the misfit that is taken for nonlinearity, however large the noise."""


@frozen(eq=False)
class Spectra:
    """Inputs (lines, m, records) and outputs (lines, p, records) at ``omega`` (lines,), rad/s."""

    omega: Array
    inputs: Complex
    outputs: Complex
    sample_period: float

    @property
    def z(self) -> Complex:
        """The lines' points on the unit circle, shape (lines,)."""
        return np.asarray(np.exp(1j * self.sample_period * self.omega))

    @property
    def slowest(self) -> float:
        """Largest modulus of a pole whose decay, and so whose resonance, the lines resolve."""
        spacing = float(np.diff(self.omega[:2])[0]) / (2.0 * np.pi)
        return float(np.exp(-spacing * self.sample_period))

    def every(self, step: int) -> "Spectra":
        """Return every ``step``-th line."""
        return Spectra(
            self.omega[::step], self.inputs[::step], self.outputs[::step], self.sample_period
        )

    def weighted(self, weight: Array) -> "Spectra":
        """Multiply each record by a weight, (lines, records) or what broadcasts to it."""
        scale = np.broadcast_to(weight, self.inputs[:, 0].shape)[:, np.newaxis, :]
        return evolve(self, inputs=self.inputs * scale, outputs=self.outputs * scale)

    def condensed(self) -> "Spectra":
        """As many records as inputs, on which every linear model has the same squared error.

        The same but for what no linear model could explain. Raises InputError where the records
        do not drive all inputs independently.
        """
        root = self._root()
        return evolve(self, inputs=root, outputs=np.asarray(self.response() @ root))

    def response(self) -> Complex:
        """Least-squares response matrix (lines, p, m); raises as ``condensed`` does."""
        power = _times(self.inputs, self.inputs)
        self._root()
        crossed = _times(self.outputs, self.inputs)
        return _adjoint(np.asarray(np.linalg.solve(power, _adjoint(crossed))))

    def _root(self) -> Complex:
        try:
            return np.asarray(np.linalg.cholesky(_times(self.inputs, self.inputs)))
        except np.linalg.LinAlgError as error:
            raise InputError(
                f"spectra: {self.inputs.shape[2]} records do not drive"
                f" {self.inputs.shape[1]} inputs independently at every line; add realisations"
            ) from error


def joined(parts: Iterable[Spectra]) -> Spectra:
    """Put the records of several spectra at the same lines side by side."""
    first, *others = parts
    if any(not np.array_equal(part.omega, first.omega) for part in others):
        raise InputError("joined spectra: their lines differ; take the same lines of each")
    inputs = np.concatenate([part.inputs for part in (first, *others)], axis=2)
    outputs = np.concatenate([part.outputs for part in (first, *others)], axis=2)
    return evolve(first, inputs=inputs, outputs=outputs)


@frozen(eq=False)
class PeriodicRecords:
    """Spectra averaged over periods; ``noise``: variance of these outputs (lines, p, records)."""

    spectra: Spectra
    noise: Array


def periodic_records(periods: Periods) -> PeriodicRecords:
    """Spectra at the lines used, of two periods or more."""
    each = np.fft.rfft(periods.output, axis=0)[periods.used]
    drive = periods.drive.mean(axis=3)
    driven = np.asarray(np.fft.rfft(drive, axis=0)[periods.used])
    frequency = np.fft.rfftfreq(len(drive), periods.sample_period)[periods.used]
    noise = each.var(axis=3, ddof=1) / each.shape[3]
    omega = np.asarray(2.0 * np.pi * frequency)
    return PeriodicRecords(Spectra(omega, driven, each.mean(axis=3), periods.sample_period), noise)


def reliability(records: PeriodicRecords) -> Array:
    """Weights (lines, records): 1 for a record without noise, less where noise adds to scatter.

    Scatter s is what differs between records beyond noise n; the weight is √(s / (s + n)), so
    that records whose misfit is nonlinearity count alike. Raises InputError where there are no
    more records than inputs.
    """
    spectra = records.spectra
    spare = spectra.inputs.shape[2] - spectra.inputs.shape[1]
    if spare < 1:
        raise InputError("reliability of records: more records than inputs are needed")
    left = spectra.outputs - spectra.response() @ spectra.inputs
    misfit = smooth(np.sum(np.abs(left) ** 2, axis=(1, 2)) / spare)
    noise = smooth(records.noise.sum(axis=1))
    scatter = np.maximum(misfit - noise.mean(axis=1), SCATTER_FLOOR * misfit)[:, np.newaxis]
    return np.asarray(np.sqrt(scatter / (scatter + noise)))


def power_by_band(
    signal: Array, band: tuple[float, float], parts: int, sample_period: float
) -> Array:
    """Mean square of a period (samples, ...) in equal parts of a ``band`` (Hz): (parts, ...).

    The line at rest is left out. What lies beyond the band belongs to the nearest part.
    """
    power = 2.0 * np.abs(np.fft.rfft(signal, axis=0)[1:] / len(signal)) ** 2
    power[(len(signal) + 1) // 2 - 1 :] /= 2.0  # half the sampling rate is a line of its own
    frequency = np.fft.rfftfreq(len(signal), sample_period)[1:]
    part = np.searchsorted(np.linspace(*band, parts + 1)[1:-1], frequency, side="right")
    return np.stack([power[part == k].sum(axis=0) for k in range(parts)])


def smooth(variance: Array) -> Array:
    """Average a variance over neighbouring lines."""
    mean = scipy.ndimage.uniform_filter1d(variance, NEIGHBOURS, axis=0, mode="nearest")
    return np.asarray(mean)


def _adjoint(matrices: Complex) -> Complex:
    return np.asarray(matrices.conj().swapaxes(1, 2))


def _times(left: Complex, right: Complex) -> Complex:
    return np.asarray(left @ _adjoint(right))
