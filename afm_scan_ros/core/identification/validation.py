"""A model against a held-out record → the error that is known of it, by band."""

from collections.abc import Sequence

import numpy as np
from attrs import evolve, frozen

from afm_scan_ros.core.bands import rms_by_band
from afm_scan_ros.core.effects.scale import resonance_of
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.extension import extended_axis
from afm_scan_ros.core.identification.alternating import AxisRecord
from afm_scan_ros.core.model import AxisModel, ModelDiscrepancy, band_edges
from afm_scan_ros.core.scanner import forward
from afm_scan_ros.core.types import Array

REST = 500
"""Samples of rest at a record's start, or coefficients of a band, that give the sensor's noise."""
DIGITS = 4
"""Digits of an rms that are kept: a band's few lines support no more."""


@frozen(eq=False)
class Validation:
    """Residual in m of one axis, shape (n,), measured minus predicted, and what follows of it."""

    residual: Array
    sample_period: float
    model_discrepancy: ModelDiscrepancy

    @property
    def sensor_noise(self) -> float:
        """Rms of the sensor's noise over all bands, m."""
        return float(np.linalg.norm(self.model_discrepancy.noise))


PREDICTED = 0.02
"""Share of a held-out record's motion up to which the model may differ."""
WEAK = 0.5
"""Share of the largest drive that the weak waves at a frequency record's end do not reach."""
LONG_ENOUGH = 0.1
"""Share of the record that they are to last."""


def validate(
    model: AxisModel,
    record: AxisRecord,
    name: str,
    first: int = 0,
    last: int | None = None,
    noise: float | None = None,
) -> Validation:
    """Predict a record from its start, at depolarised rest, and compare samples ``first`` to last.

    The ``noise`` (m) counts as white. Where it is not given, it is that of the rest before the
    first move, and without a rest that of the band in which the residual is weakest. Raises
    InputError where the drive leaves the identified range.
    """
    _refuse_beyond(model, record.drive, name)
    part, residual = slice(first, last), residual_of(model, record)
    return _validation(model, record, name, part, residual[part], record.displacement[part], noise)


def validate_from(model: AxisModel, record: AxisRecord, name: str, first: int) -> Validation:
    """Compare as ``validate`` does, of a sensor whose zero is arbitrary: no mean is compared.

    A drive may leave the identified range by what predictions may. Raises InputError beyond that.
    """
    wider = extended_axis(model, record.drive)
    _refuse_beyond(wider, record.drive, name)
    both = residual_of(wider, record), record.displacement
    centred, moved = (signal[first:] - signal[first:].mean() for signal in both)
    return _validation(model, record, name, slice(first, None), centred, moved)


def residual_of(model: AxisModel, record: AxisRecord) -> Array:
    """Displacement (m) of a record less that predicted from depolarised rest, (n,)."""
    cascade = forward(model, record.sample_period)
    return np.asarray(record.displacement - cascade.apply(cascade.at_rest(), record.drive)[1])


def _validation(
    model: AxisModel,
    record: AxisRecord,
    name: str,
    part: slice,
    residual: Array,
    displacement: Array,
    noise: float | None = None,
) -> Validation:
    """Take a residual of a part of a record, less white noise in each band, all in m rms."""
    period = record.sample_period
    bands = band_edges(period, resonance_of(model.vibration, period))
    sensor = _noise(record, residual, bands) if noise is None else noise
    of_bands = sensor * np.sqrt(np.diff(bands) / bands[-1])
    found, moved = (_by_band(signal, bands, 0.5 / bands[-1]) for signal in (residual, displacement))
    known = ModelDiscrepancy(
        record=_description(name, record, part, sensor),
        bands=bands,
        rms=_rounded(np.sqrt(np.maximum(found**2 - of_bands**2, 0.0))),
        noise=_rounded(of_bands),
        displacement=_rounded(moved),
    )
    return Validation(residual, period, known)


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


def error_on_waves(
    model: AxisModel, frequency: AxisRecord, noise: float
) -> tuple[ModelDiscrepancy, ...]:
    """What the model misses of the waves it was fitted to, the strong ones and the weak apart.

    ``noise`` (m) is the sensor's: waves begin without a rest.

    So it is known at small amplitude too, where a hysteresis model's relative error is larger,
    and near resonances that the model lacks, which few other drives strike.
    """
    size, count = np.abs(frequency.drive), len(frequency.drive)
    weak = int(np.flatnonzero(size > WEAK * size.max())[-1]) + 1
    if count - weak < LONG_ENOUGH * count:
        return (validate(model, frequency, "frequency", noise=noise).model_discrepancy,)
    return (
        validate(model, frequency, "frequency, strong waves", 0, weak, noise).model_discrepancy,
        validate(model, frequency, "frequency, weak waves", weak, None, noise).model_discrepancy,
    )


def _refuse_beyond(model: AxisModel, drive: Array, name: str) -> None:
    surface = model.hysteresis.forward
    if drive.min() < surface.lower or drive.max() > surface.upper:
        raise InputError(
            f"{name} record: drives {drive.min():.3g} to {drive.max():.3g} V, but the model goes"
            f" from {surface.lower:.3g} to {surface.upper:.3g} V; keep the drive within these"
        )


def _noise(record: AxisRecord, residual: Array, bands: tuple[float, ...]) -> float:
    """Rms (m) of white noise: in a rest before the drive first moves, or in the weakest band."""
    rest = int(np.argmax(record.drive != record.drive[0]))
    if rest >= REST:
        return float(np.std(record.displacement[:rest]))
    share = np.diff(bands) / bands[-1]
    enough = share * len(residual) >= REST
    density = rms_by_band(residual, bands, record.sample_period)[enough] / np.sqrt(share[enough])
    return float(density.min(initial=np.inf)) if enough.any() else 0.0


def _description(name: str, record: AxisRecord, part: slice, noise: float) -> str:
    drive = record.drive[part]
    seconds, rate = len(drive) * record.sample_period, 1.0 / record.sample_period
    what = f"{name}: {drive.min():.2f} to {drive.max():.2f} V, {seconds:.1f} s at {rate:.0f} Hz"
    return what if noise else f"{what}, too short to measure the noise, which is in the rms"


def _rounded(values: Array) -> tuple[float, ...]:
    return tuple(float(f"{value:.{DIGITS}g}") for value in values)
