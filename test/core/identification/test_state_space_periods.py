"""Periods are found in drives, and what cannot be cut into steady ones is refused by name."""

import numpy as np
import pytest
from attrs import evolve
from hypothesis import given, settings
from hypothesis import strategies as st

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.state_space.spectra import (
    in_periods,
    period_of_drive,
)
from afm_scan_ros.core.record import Record

LENGTH, LINES = 200, 60


def multisine(seed: int, length: int = LENGTH) -> np.ndarray:
    spectrum = np.zeros((length // 2 + 1, 2), dtype=complex)
    rng = np.random.default_rng(seed)
    spectrum[1:LINES] = np.exp(2j * np.pi * rng.random((LINES - 1, 2)))
    return np.fft.irfft(spectrum, length, axis=0)


def record(seed: int = 0, periods: int = 3, length: int = LENGTH, noise: float = 0.0) -> Record:
    one = multisine(seed, length)
    drive = np.tile(one, (periods, 1))
    drive += noise * one.std() * np.random.default_rng(seed).standard_normal(drive.shape)
    return Record(drive, 1e-6 * drive, 0.01, ("x", "y"), name=f"record {seed}")


@given(
    seed=st.integers(0, 1000),
    length=st.integers(150, 400),
    extra=st.integers(0, 149),
    noise=st.sampled_from([0.0, 0.01]),
)
@settings(deadline=None, max_examples=30)
def test_the_period_is_found_also_in_noise_and_of_incomplete_ones(
    seed: int, length: int, extra: int, noise: float
) -> None:
    whole = record(seed, 4, length, noise)
    part = evolve(whole, drive=whole.drive[extra:], displacement=whole.displacement[extra:])
    assert period_of_drive(part) == length


def test_the_lines_that_are_driven_are_used() -> None:
    found = in_periods([record(0), record(1)])
    assert found.drive.shape == (LENGTH, 2, 2, 3)
    assert np.flatnonzero(found.used).tolist() == list(range(1, LINES))


def test_what_is_kept_is_the_last_whole_periods() -> None:
    whole = record(0)
    cut = evolve(whole, drive=whole.drive[50:], displacement=whole.displacement[50:])
    found = in_periods([cut])
    assert found.drive.shape[3] == 2
    assert np.allclose(found.drive[:, :, 0, 0], whole.drive[LENGTH : 2 * LENGTH])


def test_a_drive_that_does_not_repeat_is_refused() -> None:
    noise = np.random.default_rng(0).standard_normal((600, 2))
    with pytest.raises(InputError, match="noise: its drive does not repeat within its 600 samples"):
        in_periods([Record(noise, noise, 0.01, ("x", "y"), name="noise")])


def test_a_transient_is_refused() -> None:
    begun = record(0)
    begun.displacement[:20] += 1e-6 * np.exp(-np.arange(20) / 5.0)[:, np.newaxis]
    with pytest.raises(InputError, match="record 0: its first period begins with a transient: cut"):
        in_periods([begun])


@pytest.mark.parametrize(
    ("other", "says"),
    [
        (
            evolve(record(1), sample_period=0.02),
            r"record 1: sample period \(s\): 0.02, and 0.01 in",
        ),
        (record(1, length=250), "record 1: samples in a period: 250, and 200 in record 0"),
        (evolve(record(1), drive=record(1).drive[:, :1]), "record 1: inputs: 1, and 2 in record 0"),
    ],
)
def test_records_that_are_unlike_are_refused(other: Record, says: str) -> None:
    with pytest.raises(InputError, match=says):
        in_periods([record(0), other])
