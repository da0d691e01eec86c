"""The fine steering mirror's records, and the models fitted to them, each realisation left out.

Measurements: Floren et al., ISMA-USD 2024, pp. 2042-2052, CC BY 4.0. Three inputs in V, three
outputs in m, 6400 Hz, 8192 samples a period, six realisations of two periods at each amplitude.
"""

from functools import cache

import numpy as np
from attrs import frozen

from afm_scan_bench.measured.recordings import measured_data
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.state_space.fit import fit_state_space
from afm_scan_ros.core.identification.state_space.model import StateSpaceModel
from afm_scan_ros.core.identification.state_space.spectra import (
    PeriodicRecords,
    Spectra,
    joined,
    periodic_records,
    reliability,
    response_matrix,
)
from afm_scan_ros.core.types import Array

AMPLITUDES = (100, 200, 300)
"""Of the drive, mV rms."""
REALISATIONS = range(6)
ORDER = 28
SAMPLE_PERIOD = 1.0 / 6400.0
HIGHEST = 2999.5
"""The lines driven are those below, Hz."""
SHAPE = (8192, 3, 6, 2)


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


@cache
def records(amplitude: int) -> PeriodicRecords:
    """Spectra of one amplitude's six realisations."""
    found = measured(amplitude)
    return periodic_records(found.drive, found.output, SAMPLE_PERIOD, HIGHEST)


@cache
def fitted(amplitude: int, left_out: int | None = None) -> StateSpaceModel:
    """Model of one amplitude, from all realisations but one."""
    return fit_state_space(_weighted(amplitude, left_out), ORDER)


@cache
def fitted_to_all(left_out: int) -> StateSpaceModel:
    """One model of all amplitudes, each counting by its error relative to its output."""
    parts = [_weighted(amplitude, left_out) for amplitude in AMPLITUDES]
    scaled = [part.weighted(np.array(1.0 / np.linalg.norm(part.outputs))) for part in parts]
    return fit_state_space(joined(scaled), ORDER)


def channel_errors(model: StateSpaceModel, amplitude: int, realisation: int) -> Array:
    """Squared simulation error and squared output of each channel: shape (2, 3), in m².

    Over the average of the two periods; neither measurement nor simulation has a mean.
    """
    drive, output = (
        signal[:, :, realisation].mean(axis=2)
        for signal in (measured(amplitude).drive, measured(amplitude).output)
    )
    simulated = model.steady_state(drive)
    error = (simulated - simulated.mean(axis=0)) - (output - output.mean(axis=0))
    return np.array([np.sum(error**2, axis=0), np.sum(output**2, axis=0)])


def percent(errors: Array) -> float:
    """Rms error of all channels together relative to their output's rms, in %."""
    return float(100.0 * np.sqrt(errors[0].sum() / errors[1].sum()))


def _weighted(amplitude: int, left_out: int | None) -> Spectra:
    used = records(amplitude).of([k for k in REALISATIONS if k != left_out])
    return used.spectra.weighted(reliability(used))


@frozen
class PeriodNoise:
    """Noise of one realisation's mean of two periods, and the band of 90 % of its power in Hz."""

    rms: float
    """Over all outputs together, m."""
    relative: float
    """Over the outputs' rms."""
    band: tuple[float, float]


def period_noise(amplitude: int, realisation: int) -> PeriodNoise:
    """Return what the two periods of a realisation say about its noise."""
    found = records(amplitude)
    power = found.noise[:, :, realisation].sum(axis=1)
    output = np.sum(np.abs(found.spectra.outputs[:, :, realisation]) ** 2)
    cumulated = np.cumsum(power) / power.sum()
    ends = np.searchsorted(cumulated, (0.05, 0.95))
    low, high = found.spectra.omega[ends] / (2.0 * np.pi)
    rms = np.sqrt(2.0 * power.sum()) / SHAPE[0]
    return PeriodNoise(float(rms), float(np.sqrt(power.sum() / output)), (float(low), float(high)))


def nonlinear_share(amplitude: int) -> float:
    """Rms of what in one response differs between realisations beyond noise, over its rms."""
    found = response_matrix(records(amplitude))
    sets = len(REALISATIONS) // SHAPE[1]
    nonlinear, whole = (np.linalg.norm(part) for part in (found.nonlinear, found.response))
    return float(np.sqrt(sets) * nonlinear / whole)
