"""Laws of springs and dampers in series: against scipy, under averaging, from order to order."""

import numpy as np
import pytest
from attrs import evolve
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import signal

from afm_scan_ros.core.identification.creep.record import creep_record
from afm_scan_ros.core.identification.creep.series import (
    CreepSeries,
    Held,
    OrderTried,
    choose,
    grow,
    refine,
    spring,
)
from afm_scan_ros.core.identification.records.recording import misfit
from afm_scan_ros.core.types import Array

PERIOD = 0.1
LEVELS = np.repeat([0.0, 0.5, 0.3], [100, 1500, 800])
DRIVE = np.convolve(LEVELS, np.ones(4) / 4.0)[: len(LEVELS)]  # each step takes three samples more
SERIES = st.builds(
    lambda gains, constants, slope: CreepSeries(2e-7, np.full(2, slope), gains, constants, np.inf),
    st.tuples(st.floats(0.01, 0.5), st.floats(0.01, 0.5)).map(np.array),
    st.tuples(st.floats(0.3, 5.0), st.floats(15.0, 1000.0)).map(np.array),
    st.floats(1e-6, 1e-5),
)


def integrated(series: CreepSeries) -> Array:
    """Return what scipy makes of the drive, of one slope for all steps."""
    moved = DRIVE.copy()
    for gain, tau in zip(series.gains, series.time_constants, strict=True):
        numerator, denominator, _ = signal.cont2discrete(([gain], [tau, 1.0]), PERIOD)
        moved += signal.lfilter(numerator[0], denominator, DRIVE)
    return np.asarray(series.origin + series.slopes[0] * moved)


@settings(deadline=None, max_examples=30)
@given(SERIES)
def test_prediction_is_what_scipy_integrates_also_averaged(series: CreepSeries) -> None:
    record = creep_record(DRIVE, integrated(series), PERIOD)
    np.testing.assert_allclose(series.predict(record), record.displacement, rtol=1e-9)
    averaged = record.averaged()
    assert len(averaged.first) < 0.2 * len(record.first)
    assert averaged.count.sum() == len(record.first)
    np.testing.assert_allclose(series.predict(averaged), averaged.displacement, rtol=1e-9)


@settings(deadline=None, max_examples=10)
@given(SERIES)
def test_series_is_found_again(series: CreepSeries) -> None:
    averaged = creep_record(DRIVE, integrated(series), PERIOD).averaged()
    found = grow(averaged, grow(averaged, spring()))
    np.testing.assert_allclose(found.time_constants, series.time_constants, rtol=1e-3)
    np.testing.assert_allclose(found.gains, series.gains, rtol=1e-3)


@settings(deadline=None, max_examples=10)
@given(SERIES, st.integers(0, 2**32 - 1))
def test_one_more_element_never_fits_worse_and_a_held_one_never_better(
    series: CreepSeries, seed: int
) -> None:
    noise = 2e-8 * np.random.default_rng(seed).standard_normal(len(DRIVE))
    averaged = creep_record(DRIVE, integrated(series) + noise, PERIOD).averaged()
    one = grow(averaged, spring())
    two = grow(averaged, one)
    assert two.cost <= one.cost * (1.0 + 1e-6)
    for parameter, value in (("gain", two.gains[0]), ("time_constant", two.time_constants[0])):
        held = refine(averaged, two, Held(parameter, 0, 1.1 * value))
        assert held.cost >= two.cost * (1.0 - 1e-6)
        fixed = {"gain": held.gains, "time_constant": held.time_constants}[parameter]
        assert fixed[0] == pytest.approx(1.1 * value, rel=1e-6)


@settings(deadline=None, max_examples=10)
@given(SERIES, st.floats(0.1, 10.0), st.floats(-1e-6, 1e-6))
def test_gain_and_origin_of_the_sensor_do_not_matter(
    series: CreepSeries, scale: float, offset: float
) -> None:
    record = creep_record(DRIVE, integrated(series), PERIOD).averaged()
    other = evolve(record, displacement=scale * record.displacement + offset)
    one, two = grow(record, spring()), grow(other, spring())
    np.testing.assert_allclose(one.gains, two.gains, rtol=1e-3)  # as well as a search ends
    np.testing.assert_allclose(one.time_constants, two.time_constants, rtol=1e-3)


def tried(gains: list[float], error: Array) -> OrderTried:
    constants = np.arange(1.0, len(gains) + 1.0)
    series = CreepSeries(0.0, np.ones(1), np.array(gains), constants, 0.0)
    return OrderTried(series, misfit(error), misfit(error), error)


def test_order_is_the_smallest_that_predicts_as_well_with_positive_gains() -> None:
    noise = np.random.default_rng(0).standard_normal(1000)
    drifting = noise + np.linspace(0.0, 1.0, len(noise))
    one, two, three = tried([0.1], drifting), tried([0.1, 0.1], noise), tried([0.1] * 3, noise)
    assert choose([one, two, three]) is two
    assert choose([one, tried([0.1, -0.1], noise), three]) is three
    assert choose([tried([-0.1], drifting), tried([0.1, -0.1], noise)]).order == 1
