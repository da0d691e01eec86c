"""Noise has as many amplitudes as coefficients, the model's error few, wherever it lies."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import f

from afm_scan_ros.core.diagnosis.cells import RecordCells
from afm_scan_ros.core.diagnosis.discrepancy import DetectionLimit
from afm_scan_ros.core.diagnosis.repetition import Repetition
from afm_scan_ros.core.diagnosis.settings import PARTING, VARIANCE
from afm_scan_ros.core.diagnosis.variance import CellVariance, satterthwaite
from afm_scan_ros.core.types import Array

COUNT, PERIOD, PERIODS = 16_000, 1e-3, 40.0
EDGES = (0.0, 3.0, 10.0, 30.0, 100.0, 500.0)
CELLS = RecordCells(EDGES, COUNT, PERIOD, Repetition(0, COUNT, PERIODS))
NOISE = np.sqrt(np.diff(EDGES) / EDGES[-1])
LIMIT = DetectionLimit(EDGES, np.hypot(NOISE, 2.0), NOISE, 50.0)
MOVED = 1e3 * np.interp(
    np.linspace(0.0, PERIODS, COUNT, endpoint=False) % 1.0, (0.0, 0.5, 1.0), (-1.0, 1.0, -1.0)
)
SIZES = st.floats(1e-3, 1e3)


def found(residual: Array) -> CellVariance:
    return CellVariance.repeating(LIMIT, CELLS, MOVED, residual, VARIANCE.known)


@given(one=SIZES, other=SIZES, few=SIZES, many=SIZES)
def test_both_together_have_no_fewer_amplitudes_than_either(
    one: float, other: float, few: float, many: float
) -> None:
    together = satterthwaite(np.array(one), np.array(other), few, many)
    assert min(few, many) * (1.0 - 1e-9) <= together <= (few + many) * (1.0 + 1e-9)


def test_noise_between_the_harmonics_has_as_many_amplitudes_as_coefficients() -> None:
    """Those with the motion are few: what the model gets wrong there has no more."""
    variance = found(np.random.default_rng(1).standard_normal(COUNT))
    along, between = variance.freedom.reshape(2, CELLS.bands)
    np.testing.assert_array_equal(along, VARIANCE.freedom)
    np.testing.assert_array_less(100.0, between[2:])
    np.testing.assert_allclose(
        variance.total[CELLS.bands + 2 :], (CELLS.counts / COUNT)[CELLS.bands + 2 :], rtol=0.2
    )


def test_an_error_at_a_resonance_is_no_noise_of_the_bands_beside() -> None:
    """It ends where the record ends, which spreads it over all frequencies."""
    rng, time = np.random.default_rng(4), np.arange(COUNT) * PERIOD
    swings = np.interp(time, np.arange(0.0, 18.0, 2.0), rng.standard_normal(9))
    resonance = 300.0 * (1.0 + swings) * np.sin(2.0 * np.pi * 60.3 * time)
    without = rng.standard_normal(COUNT)
    noise = [found(each).noise[CELLS.bands :] for each in (without, without + resonance)]
    np.testing.assert_allclose(noise[1][[2, 4]], noise[0][[2, 4]], rtol=0.1)


def test_what_leaks_of_the_error_has_few_amplitudes() -> None:
    """An error of the motion that changes from period to period leaves no room for more."""
    rng = np.random.default_rng(2)
    errs = np.repeat(rng.standard_normal(int(PERIODS)), COUNT // int(PERIODS)) * 3e-3 * MOVED
    variance = found(errs + rng.standard_normal(COUNT))
    leaking = CELLS.bands + 2
    assert variance.freedom[leaking] < 0.1 * CELLS.counts[leaking]
    assert variance.total[leaking] > 1.1 * variance.noise[leaking]


@pytest.mark.parametrize("factor", [0.7, 1.5])
def test_the_record_tells_its_own_noise(factor: float) -> None:
    """Within a factor of two of that of the calibration; a tone is no noise."""
    tone = 0.3 * np.sin(2.0 * np.pi * 61.3 * PERIOD * np.arange(COUNT))
    seen = found(factor * np.random.default_rng(3).standard_normal(COUNT) + tone)
    expected = factor**2 * (CELLS.counts / COUNT)[CELLS.bands + 3]
    assert seen.noise[CELLS.bands + 3] == pytest.approx(expected, rel=0.1)
    loud = found(10.0 * np.random.default_rng(3).standard_normal(COUNT))
    most = PARTING.other_noise**2 * (CELLS.counts / COUNT)[CELLS.bands + 3]
    assert loud.noise[CELLS.bands + 3] == pytest.approx(most, rel=0.01)


def test_at_rest_all_is_noise_but_what_moves() -> None:
    cells = RecordCells(EDGES, COUNT, PERIOD)
    still = DetectionLimit(EDGES, NOISE, NOISE, 50.0)
    variance = CellVariance.at_rest(still, cells, np.zeros(COUNT), VARIANCE.known)
    np.testing.assert_allclose(variance.freedom, cells.counts)
    drifting = CellVariance.at_rest(still, cells, np.linspace(0.0, 3.0, COUNT), VARIANCE.known)
    assert drifting.freedom[0] < 2.0 * VARIANCE.freedom


def test_what_exceeds_the_error_of_healthy_records_is_none_of_the_model() -> None:
    """A gain that wanders lies beside the harmonics, a hundred times the limit."""
    wander = np.sin(2.0 * np.pi * 7.5 * np.arange(COUNT) / COUNT)
    variance = found(MOVED * wander + np.random.default_rng(3).standard_normal(COUNT))
    _, between = variance.total.reshape(2, CELLS.bands)
    most = (
        VARIANCE.typical_share
        * 2.0**2
        * f.isf(PARTING.false_alarm, VARIANCE.freedom, VARIANCE.known)
    )
    assert between[0] <= most + PARTING.other_noise**2 * NOISE[0] ** 2
    power = CELLS.power(CELLS.coefficients(MOVED * wander))[CELLS.bands]
    assert power > 100.0 * between[0]
