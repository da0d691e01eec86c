"""How far a scanner may be from its model: by held-out records, and by the parameters of the fit.

The discrepancy of a record k is a share η_k of its motion m_k. Of a record that was held out it is
what the model misses beyond the sensor's noise n_k and beyond what its parameters explain,

    (η_k m_k)² = e_k² - n_k² - Σ_i var((y_i - y_c) / d_i),

and of one that was fitted what the fit leaves beyond noise. In each band η² is the mean of the
records held out that move there, or else of those fitted, or else the largest. Added are the
squares of ``least_discrepancy`` and of what the model loses of the fit's own scans from rest, but
for their mean.
"""

from collections.abc import Iterator, Sequence
from functools import partial
from typing import TypeAlias

import numpy as np
from attrs import evolve, frozen

from afm_scan_ros.core.bands import rms_by_band
from afm_scan_ros.core.diagnosis.discrepancy import places_moved
from afm_scan_ros.core.effects.scale import resonance_of
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.fit.model_of_fit import lost_by
from afm_scan_ros.core.fit.noise import noise_of
from afm_scan_ros.core.fit.told import Knowledge
from afm_scan_ros.core.identification.records.recording import Misfit, misfit
from afm_scan_ros.core.intersample import held_voltages, moved_by
from afm_scan_ros.core.model import AxisModel, ModelDiscrepancy, band_edges
from afm_scan_ros.core.prediction import apart, extended_axis
from afm_scan_ros.core.record import Record
from afm_scan_ros.core.scanner import forward
from afm_scan_ros.core.spread import Spread
from afm_scan_ros.core.types import Array

REST = 500
"""Samples of rest at a record's start, or coefficients of a band, that give the sensor's noise."""
DIGITS = 4
"""Digits of an rms that are kept: a band's few lines support no more."""
PREDICTED = 0.02
"""Share of a held-out record's motion up to which the model may differ."""

Missed: TypeAlias = tuple[Array, float]
"""Rms motion (m) of a record in each band, (bands,), and the squared share that is missed."""


@frozen(eq=False)
class Validation:
    """Residual in m of a ``record`` of one axis, (n,), measured minus predicted."""

    record: str
    residual: Array
    sample_period: float
    model_discrepancy: ModelDiscrepancy

    @property
    def misfit(self) -> Misfit:
        """Standard deviation and maximum of the residual, m (Eqs. 2, 3)."""
        return misfit(self.residual)


def validate_from(model: AxisModel, record: Record, first: int) -> Validation:
    """Predict a record of one axis from depolarised rest, and compare it from a sample on.

    The sensor's zero is arbitrary, so that no mean is compared. Its noise is that of the rest
    before the first move, and without a rest that of the band in which the residual is weakest.
    The drive may leave the identified range by what predictions may. Raises InputError beyond that.
    """
    (axis,) = record.axes
    drive, displacement = record.signals(axis)
    voltages = held_voltages(drive, record.intersample)
    wider = extended_axis(model, voltages)
    _refuse_beyond(wider, voltages, record.name)
    period = record.sample_period
    predicted = moved_by(partial(forward, wider), drive, period, record.intersample)
    both = displacement - predicted, displacement
    residual, moved = (signal[first:] - signal[first:].mean() for signal in both)
    bands = band_edges(period, resonance_of(model.vibration, period))
    sensor = _noise(drive, displacement, residual, bands)
    of_bands = sensor * np.sqrt(np.diff(bands) / bands[-1])
    found, motion = (_by_band(signal, bands, 0.5 / bands[-1]) for signal in (residual, moved))
    known = ModelDiscrepancy(
        record=_description(record.name, drive[first:], period, sensor),
        bands=bands,
        rms=_rounded(np.sqrt(np.maximum(found**2 - of_bands**2, 0.0))),
        noise=_rounded(of_bands),
        displacement=_rounded(motion),
    )
    return Validation(record.name, residual, period, known)


def of_fitted(known: ModelDiscrepancy, share: float) -> ModelDiscrepancy:
    """What is known by a record that was fitted: in each band at least a share of the motion."""
    rms = np.maximum(known.rms, share * np.array(known.displacement))
    return evolve(known, rms=_rounded(rms), fitted=True)


def _by_band(signal: Array, bands: Sequence[float], sample_period: float) -> Array:
    """Rms in each band; the mean is as slow as a motion can be, and counts with the slowest.

    A record that ends elsewhere than it began holds no jump, which would pass for motion at every
    frequency and make the relative error look small where there is hardly any.
    """
    found = rms_by_band(signal, bands, sample_period)
    found[0] = np.hypot(found[0], signal.mean())
    return found


def _refuse_beyond(model: AxisModel, drive: Array, name: str) -> None:
    lower, upper = model.hysteresis.forward.drive_range
    if drive.min() < lower or drive.max() > upper:
        raise InputError(
            f"{name} record: drives {drive.min():.3g} to {drive.max():.3g} V, but the model goes"
            f" from {lower:.3g} to {upper:.3g} V; keep the drive within these"
        )


def _noise(drive: Array, moved: Array, residual: Array, bands: tuple[float, ...]) -> float:
    """Rms (m) of white noise: in a rest before the drive first moves, or in the weakest band."""
    rest = int(np.argmax(drive != drive[0]))
    if rest >= REST:
        return float(np.std(moved[:rest]))
    share = np.diff(bands) / bands[-1]
    enough = share * len(residual) >= REST
    density = rms_by_band(residual, bands, 0.5 / bands[-1])[enough] / np.sqrt(share[enough])
    return float(density.min(initial=np.inf)) if enough.any() else 0.0


def _description(name: str, drive: Array, period: float, noise: float) -> str:
    seconds, rate = len(drive) * period, 1.0 / period
    what = f"{name}: {drive.min():.2f} to {drive.max():.2f} V, {seconds:.1f} s at {rate:.0f} Hz"
    return what if noise else f"{what}, too short to measure the noise, which is in the rms"


def _rounded(values: Array) -> tuple[float, ...]:
    return tuple(float(f"{value:.{DIGITS}g}") for value in values)


def spread_of(
    known: Knowledge, model: AxisModel, held_out: Sequence[tuple[Record, Validation]]
) -> Spread:
    """Return how far the scanner may be from the model of its fit.

    Records of one axis were ``held_out``, and count where their validation begins.
    """
    period = known.fit.shortest
    bands = band_edges(period, resonance_of(model.vibration, period))
    rest_known = any(one.rested for one in known.fit.records)
    spread = Spread(*known.variants(), bands, np.zeros(len(bands) - 1), rest_known)
    least = known.fit.layout.settings.least_discrepancy
    fitted = list(_missed_by_fit(known, bands))
    shares = _mean_by_band(fitted, np.full(len(bands) - 1, max(squared for _, squared in fitted)))
    shares = _mean_by_band([_left_out(model, spread, *one) for one in held_out], shares)
    return evolve(spread, shares=np.sqrt(least**2 + lost_by(model, known.fit) + shares))


def _missed_by_fit(known: Knowledge, bands: Sequence[float]) -> Iterator[Missed]:
    """Yield what the fit leaves of its records beyond noise."""
    for one, left in zip(known.fit.records, known.fit.residuals(), strict=True):
        beyond = max(float(np.mean(left**2)) - one.noise**2 / one.block, 0.0)
        yield rms_by_band(one.displacement, bands, one.period), beyond / one.motion**2


def _left_out(model: AxisModel, spread: Spread, record: Record, seen: Validation) -> Missed:
    """What the model leaves of a record beyond noise and beyond what its parameters explain."""
    drive, displacement = record.signals(record.axes[0])
    part, period = slice(len(drive) - len(seen.residual), None), record.sample_period
    each = apart(model, spread, drive, period, intersample=record.intersample)
    explained = np.var(each[:, part], axis=1).sum()
    error = float(np.var(seen.residual)) - noise_of(seen.residual) ** 2
    squared = max(error - float(explained), 0.0) / float(np.var(displacement[part]))
    return rms_by_band(displacement[part], spread.bands, period), squared


def _mean_by_band(records: Sequence[Missed], otherwise: Array) -> Array:
    """Mean squared share (bands,) of the records that move in a band, or what it is otherwise."""
    moving = np.zeros((len(records), len(otherwise)))
    for row, (moved, _) in zip(moving, records, strict=True):
        row[places_moved(moved)] = 1.0
    count = moving.sum(axis=0)
    total = np.array([squared for _, squared in records]) @ moving
    return np.where(count > 0.0, total / np.maximum(count, 1.0), otherwise)
