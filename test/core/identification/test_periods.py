"""The period of a drive is read from its samples."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from afm_scan_ros.core.identification.drives.waveforms import multisine
from afm_scan_ros.core.identification.records.periods import is_periodic, repeated_part, repetition
from afm_scan_ros.core.types import Array


def drive_of(period: int, seed: int) -> Array:
    """Three multisines of six periods each."""
    rng = np.random.default_rng(seed)
    spectrum = np.zeros((3, period // 2 + 1), dtype=np.complex128)
    lines = np.arange(2, period // 4)
    spectrum[:, lines] = np.exp(2j * np.pi * rng.random((3, len(lines)))) / lines
    return multisine(period * np.fft.irfft(spectrum, period), 6)


@settings(max_examples=25, deadline=None)
@given(period=st.integers(100, 900), seed=st.integers(0, 99))
def test_period_is_read_from_the_drive(period: int, seed: int) -> None:
    assert repetition(drive_of(period, seed)[:, np.newaxis]) == period


@pytest.mark.parametrize("rests", [(0, 9137), (9137, 0)])
def test_a_rest_before_or_after_hides_no_period(rests: tuple[int, int]) -> None:
    before, after = (np.zeros(rest) for rest in rests)
    drive = np.concatenate([before, drive_of(1000, 3), after])[:, np.newaxis]
    assert repetition(drive) == 1000
    assert is_periodic(drive)


def test_noise_and_sines_out_of_step_with_the_sampling_have_no_period() -> None:
    noise = np.random.default_rng(0).standard_normal(20_000)
    sine = np.sin(2.0 * np.pi * np.arange(8000) / 100.37)
    assert not any(is_periodic(each[:, np.newaxis]) for each in (noise, sine))


@settings(max_examples=25, deadline=None)
@given(
    period=st.floats(100.0, 900.0),
    cycles=st.floats(5.0, 12.0),
    shares=st.tuples(st.floats(0.02, 0.4), st.floats(0.02, 0.4)),
)
def test_the_part_that_repeats_lies_between_the_ramps_to_it(
    period: float, cycles: float, shares: tuple[float, float]
) -> None:
    """Triangles about 3 V of any length of period, reached from 0 V and left again."""
    ramps = [int(share * period) for share in shares]
    count = int(cycles * period)
    wave = 3.0 + np.interp(np.arange(count) / period % 1.0, [0.0, 0.5, 1.0], [0.0, 1.0, 0.0])
    up, down = np.linspace(0.0, wave[0], ramps[0]), np.linspace(wave[-1], 0.0, ramps[1])
    found = repeated_part(np.concatenate([up, wave, down]))
    assert found is not None
    first, last, samples = found
    assert abs(samples - period) <= 1.0
    assert abs(first - ramps[0]) <= 0.1 * period + 2.0
    assert abs(last - ramps[0] - count) <= 0.1 * period + 2.0


@pytest.mark.parametrize("drive", [np.zeros(500), np.linspace(0.0, 1.0, 500), np.ones(1)])
def test_a_rest_and_a_ramp_have_no_part_that_repeats(drive: Array) -> None:
    assert repeated_part(drive) is None
