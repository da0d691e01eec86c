"""The fine steering mirror's records, models identified from some of them, and their errors.

Measurements: Floren et al., ISMA-USD 2024, pp. 2042-2052, CC BY 4.0. Three inputs in V, three
outputs in m, 6400 Hz, 8192 samples a period, six realisations of two periods at each amplitude.
"""

from functools import cache

import numpy as np
from attrs import frozen

import afm_scan_ros as afm
from afm_scan_bench.measured.recordings import measured_data
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.state_space.spectra import (
    PeriodicRecords,
    Periods,
    periodic_records,
)
from afm_scan_ros.core.types import Array

AMPLITUDES = (100, 200, 300)
"""Of the drive, mV rms."""
REALISATIONS = range(6)
FOLDS = ((0, 5), (1, 4), (2, 3))
"""Realisations left out together."""
SAMPLE_PERIOD = 1.0 / 6400.0
HIGHEST = 2999.5
"""The lines driven are those below, Hz."""
SHAPE = (8192, 3, 6, 2)
AXES = ("1", "2", "3")
EFFECTS = ("amplitude_softening", "maxwell_slip")


@frozen(eq=False)
class Measured:
    """All of one amplitude: ``drive`` in V and ``output`` in m, each of shape ``SHAPE``."""

    drive: Array
    output: Array


@cache
def measured(amplitude: int) -> Measured:
    """Read the records of one amplitude; raises InputError where they are missing or not such."""
    folder = measured_data("piezo_fsm")
    arrays = []
    for name in (f"u_{amplitude}mV_train.npy", f"y_{amplitude}mV_train.npy"):
        if not (folder / name).is_file():
            raise InputError(f"{folder / name}: no such file: fetch all of fsm-benchmark-data")
        arrays.append(np.load(folder / name))
        if arrays[-1].shape != SHAPE:
            raise InputError(f"{folder / name}: shape {arrays[-1].shape}, expected {SHAPE}")
    return Measured(*arrays)


def record(amplitude: int, realisation: int) -> afm.Record:
    """Both periods of a realisation, one after the other."""
    found = measured(amplitude)
    drive, output = (
        np.moveaxis(signal[:, :, realisation], 2, 0).reshape(-1, SHAPE[1])
        for signal in (found.drive, found.output)
    )
    name = f"{amplitude} mV, realisation {realisation}"
    return afm.Record(drive, output, SAMPLE_PERIOD, AXES, name=name)


@cache
def identified(
    amplitudes: tuple[int, ...],
    left_out: tuple[int, ...],
    effects: tuple[str, ...] = (),
    states: int | None = None,
) -> afm.Model:
    """Identify the realisations of some amplitudes but those left out."""
    kept = [k for k in REALISATIONS if k not in left_out]
    records = [record(amplitude, k) for amplitude in amplitudes for k in kept]
    return afm.identify(records, effects=effects, states=states)


def predicted(model: afm.Model, amplitude: int, realisation: int) -> Array:
    """Steady state of a realisation, (samples, 3) in m."""
    drive = measured(amplitude).drive[:, :, realisation].mean(axis=2)
    return model.predict(drive, SAMPLE_PERIOD, periodic=True)


def squares(simulation: Array, amplitude: int, realisation: int) -> Array:
    """Squared simulation error and squared output of each channel: shape (2, 3), in m².

    Over the average of the two periods; neither measurement nor simulation has a mean.
    """
    output = measured(amplitude).output[:, :, realisation].mean(axis=2)
    error, own = (signal - signal.mean(axis=0) for signal in (simulation - output, output))
    return np.array([np.sum(error**2, axis=0), np.sum(own**2, axis=0)])


def percent(errors: Array) -> float:
    """Rms error of all channels together relative to their output's rms, in %."""
    return float(100.0 * np.sqrt(errors[0].sum() / errors[1].sum()))


def score(simulation: Array, amplitude: int, realisation: int) -> float:
    """Rmse in m as the benchmark defines it: mean over outputs and both periods, means kept.

    ``submission_examples/FineSteeringMirror.py`` of ``nonlinear_benchmarks`` is the definition.
    """
    residual = simulation[:, :, np.newaxis] - measured(amplitude).output[:, :, realisation]
    return float(np.mean(np.sqrt(np.mean(residual**2, axis=0))))


@cache
def spectra(amplitude: int) -> PeriodicRecords:
    """Spectra of one amplitude's six realisations, with the noise of each."""
    found = measured(amplitude)
    frequency = np.fft.rfftfreq(SHAPE[0], SAMPLE_PERIOD)
    used = (frequency > 0.0) & (frequency < HIGHEST)
    return periodic_records(Periods(found.drive, found.output, SAMPLE_PERIOD, used))


@frozen
class PeriodNoise:
    """Noise of one realisation's mean of two periods, and the band of 90 % of its power in Hz."""

    rms: float
    """Over all outputs together, m."""
    relative: float
    """Over the outputs' rms."""
    band: tuple[float, float]


def period_noise(amplitude: int, realisation: int) -> PeriodNoise:
    """Return the noise of a realisation by the difference of its two periods."""
    found = spectra(amplitude)
    power = found.noise[:, :, realisation].sum(axis=1)
    output = np.sum(np.abs(found.spectra.outputs[:, :, realisation]) ** 2)
    cumulated = np.cumsum(power) / power.sum()
    ends = np.searchsorted(cumulated, (0.05, 0.95))
    low, high = found.spectra.omega[ends] / (2.0 * np.pi)
    rms = np.sqrt(2.0 * power.sum()) / SHAPE[0]
    return PeriodNoise(float(rms), float(np.sqrt(power.sum() / output)), (float(low), float(high)))
