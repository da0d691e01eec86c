"""A model against a held-out record → the error that is known of it, by band."""

from collections.abc import Sequence
from functools import partial

import numpy as np
from attrs import evolve, frozen

from afm_scan_ros.core.bands import rms_by_band
from afm_scan_ros.core.effects.scale import resonance_of
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.records.recording import Misfit, misfit
from afm_scan_ros.core.intersample import held_voltages, moved_by
from afm_scan_ros.core.model import AxisModel, ModelDiscrepancy, band_edges
from afm_scan_ros.core.prediction import extended_axis
from afm_scan_ros.core.record import Record
from afm_scan_ros.core.scanner import forward
from afm_scan_ros.core.types import Array

REST = 500
"""Samples of rest at a record's start, or coefficients of a band, that give the sensor's noise."""
DIGITS = 4
"""Digits of an rms that are kept: a band's few lines support no more."""


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


PREDICTED = 0.02
"""Share of a held-out record's motion up to which the model may differ."""


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
    both = residual_of(wider, record), displacement
    residual, moved = (signal[first:] - signal[first:].mean() for signal in both)
    period = record.sample_period
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


def residual_of(model: AxisModel, record: Record) -> Array:
    """Displacement (m) of a record of one axis less that predicted from depolarised rest, (n,)."""
    drive, displacement = record.signals(record.axes[0])
    moved = moved_by(partial(forward, model), drive, record.sample_period, record.intersample)
    return np.asarray(displacement - moved)


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
