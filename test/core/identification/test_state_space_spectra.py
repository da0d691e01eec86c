"""Noisier records count less; condensing loses nothing a model could use."""

import numpy as np
import pytest
from attrs import evolve
from numpy.testing import assert_allclose
from test_state_space import PERIOD, random_form

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.state_space.fit import squared_error
from afm_scan_ros.core.identification.state_space.spectra import (
    PeriodicRecords,
    Periods,
    joined,
    periodic_records,
    reliability,
)
from afm_scan_ros.core.types import Array

SAMPLES = 1024
USED = np.arange(SAMPLES // 2 + 1) * (1.0 / (SAMPLES * PERIOD)) < 450.0
USED[0] = False
MODEL = random_form(seed=3, pairs=2, real=1, outputs=2, inputs=2).realised(PERIOD)


def records(noise: Array, cubic: float = 0.0, seed: int = 0) -> PeriodicRecords:
    """Two periods of four random-phase realisations, with noise of a given rms in each."""
    rng = np.random.default_rng(seed)
    lines = np.zeros((SAMPLES // 2 + 1, 2, 4), dtype=complex)
    lines[1:462] = np.exp(2j * np.pi * rng.random((461, 2, 4)))
    drive = np.fft.irfft(lines, SAMPLES, axis=0) * np.sqrt(SAMPLES)
    through = [MODEL.steady_state(drive[:, :, k] + cubic * drive[:, :, k] ** 3) for k in range(4)]
    output = np.stack([np.stack(through, axis=2)] * 2, axis=3)
    output = output + noise[:, np.newaxis] * rng.standard_normal(output.shape)
    return periodic_records(Periods(np.stack([drive] * 2, axis=3), output, PERIOD, USED))


def test_noise_of_the_mean_is_half_that_of_a_period() -> None:
    found = records(np.full(4, 0.1))
    assert np.mean(found.noise) == pytest.approx(SAMPLES * 0.1**2 / 2.0, rel=0.05)


def test_condensed_records_differ_by_a_constant() -> None:
    spectra = records(np.full(4, 0.1)).spectra
    forms = [random_form(seed, pairs=2, real=0, outputs=2, inputs=2) for seed in (1, 2, 3)]
    all_of_it = [squared_error(form, spectra) for form in forms]
    condensed = [squared_error(form, spectra.condensed()) for form in forms]
    assert_allclose(np.diff(all_of_it), np.diff(condensed), rtol=1e-9)
    assert spectra.condensed().inputs.shape[2] == 2


def test_noisier_record_counts_less() -> None:
    weight = reliability(records(np.array([0.0, 0.0, 0.0, 1.0]), cubic=0.02))
    assert_allclose(weight[:, :3], 1.0)
    assert weight[:, 3].max() < 0.9


def test_joined_records_are_columns() -> None:
    parts = [records(np.zeros(4), seed=seed).spectra for seed in (0, 1)]
    assert joined(parts).inputs.shape[2] == 8
    with pytest.raises(InputError, match="lines differ"):
        joined([parts[0], parts[1].every(2)])


def test_records_that_tell_nothing_are_refused() -> None:
    found = records(np.zeros(4))
    inputs, outputs = found.spectra.inputs, found.spectra.outputs
    one, two = (
        evolve(found.spectra, inputs=inputs[:, :, :k], outputs=outputs[:, :, :k]) for k in (1, 2)
    )
    with pytest.raises(InputError, match="do not drive 2 inputs"):
        one.condensed()
    with pytest.raises(InputError, match="more records than inputs"):
        reliability(PeriodicRecords(two, found.noise[:, :, :2]))
