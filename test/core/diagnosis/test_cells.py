"""A signal is parted with a motion that repeats and between its harmonics, without loss."""

import numpy as np
import pytest
from attrs import evolve
from hypothesis import given, settings
from hypothesis import strategies as st

from afm_scan_ros.core.diagnosis.cells import RecordCells
from afm_scan_ros.core.diagnosis.repetition import Repetition
from afm_scan_ros.core.types import Array

COUNT, PERIOD = 6000, 1e-3
EDGES = (0.0, 3.0, 10.0, 30.0, 100.0, 500.0)
PARTED = RecordCells(EDGES, COUNT, PERIOD, Repetition(500, 5900, 20.25))
SEEDS, PERIODS = st.integers(0, 2**32 - 1), st.floats(4.0, 300.0)


def noise(seed: int) -> Array:
    found = np.random.default_rng(seed).standard_normal(COUNT)
    return np.asarray(found - found.mean())


def triangle(periods: float, within: slice = slice(None)) -> Array:
    """Triangle of so many periods in some samples, at rest before and after."""
    moved = np.zeros(COUNT)
    phase = np.linspace(0.0, periods, len(moved[within]), endpoint=False) % 1.0
    moved[within] = np.interp(phase, (0.0, 0.25, 0.75, 1.0), (0.0, 1.0, -1.0, 0.0))
    return moved


@settings(deadline=None)
@given(seed=SEEDS, periods=PERIODS)
def test_the_parts_are_orthogonal_and_add_up(seed: int, periods: float) -> None:
    of = Repetition(500, 5900, periods)
    signal = noise(seed)
    between = np.zeros(COUNT)
    between[500:5900] = of.signal(of.between(signal[np.newaxis])[0])
    assert between @ (signal - between) == pytest.approx(0.0, abs=2e-3 * (signal @ signal))
    again = np.zeros(COUNT)
    again[500:5900] = of.signal(of.between(between[np.newaxis])[0])
    assert np.linalg.norm(again - between) <= 0.1 * np.linalg.norm(between)


@given(seed=SEEDS)
def test_squares_of_coefficients_add_to_the_mean_square(seed: int) -> None:
    signal = noise(seed)
    for cells in (PARTED, evolve(PARTED, repetition=None)):
        found = cells.coefficients(signal)
        assert cells.power(found).sum() == pytest.approx(np.mean(signal**2), rel=1e-3)
        np.testing.assert_allclose(cells.signal(found), signal, atol=1e-9)
        assert len(cells.spread(cells.counts)) == len(found)


@settings(deadline=None)
@given(periods=PERIODS)
def test_nothing_of_a_motion_that_repeats_lies_between(periods: float) -> None:
    of = Repetition(0, COUNT, periods)
    assert of.share_between(triangle(periods)) < 1e-3
    growing = triangle(periods) * np.linspace(1.0, 1.1, COUNT)
    assert of.share_between(growing) < 2e-3


def test_white_noise_has_as_much_in_each_coefficient() -> None:
    """Over many draws, within three standard deviations of a chi-squared mean."""
    draws = np.array([PARTED.power(PARTED.coefficients(noise(k))) for k in range(60)])
    expected = PARTED.counts / COUNT
    wide = PARTED.counts > 20.0
    spread = 3.0 * np.sqrt(2.0 / PARTED.counts / len(draws))
    off = np.abs(draws.mean(axis=0) / expected - 1.0)
    np.testing.assert_array_less(off[wide], spread[wide] + 0.12)


def test_a_tone_between_the_harmonics_is_between() -> None:
    time = PERIOD * np.arange(COUNT)
    rate = 20.25 / (5400 * PERIOD)
    for turns, share in ((5.5, 0.85), (5.0, 0.0)):
        tone = np.sin(2.0 * np.pi * turns * rate * time)
        power = PARTED.power(PARTED.coefficients(tone))
        between = power[PARTED.bands :].sum() / power.sum()
        assert between == pytest.approx(share, abs=0.06)


@pytest.mark.parametrize("periods", [4.9, 12.37, 63.8])
def test_the_number_of_periods_is_found_from_a_spectral_line(periods: float) -> None:
    cells = evolve(PARTED, repetition=None)
    line = round(periods) / (COUNT * PERIOD)
    found = cells.repeating(triangle(periods), (3.1 * line, line)).repetition
    if periods - 1.0 < 4.0:
        assert found is None
        return
    assert found is not None
    assert found.periods / found.count == pytest.approx(periods / COUNT, rel=1e-3)
    assert found.first == round(COUNT / periods)


def test_what_does_not_repeat_is_not_parted() -> None:
    cells = evolve(PARTED, repetition=None)
    swept = np.sin(200.0 * np.linspace(0.0, 1.0, COUNT) ** 2)
    assert cells.repeating(swept, (5.0, 11.0)) == cells
    assert cells.repeating(np.zeros(COUNT), (5.0,)) == cells
    assert cells.repeating(triangle(3.0), (0.5,)) == cells


def test_an_overtone_is_no_rate_of_repetition() -> None:
    """Between the teeth of five times the rate the motion itself would lie."""
    cells = evolve(PARTED, repetition=None)
    found = cells.repeating(triangle(8.0), (40.0 / (COUNT * PERIOD),))
    assert found.repetition is None
