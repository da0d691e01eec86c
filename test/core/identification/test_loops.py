"""A Preisach surface from arbitrary loops: the areas against the walk, the fit against a truth."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from afm_scan_ros.core.effects.creep import CreepModel
from afm_scan_ros.core.effects.hysteresis.everett import BeyondRangeError
from afm_scan_ros.core.effects.hysteresis.preisach import Preisach
from afm_scan_ros.core.effects.optimal_inverse import SmoothWeight
from afm_scan_ros.core.effects.vibration import InverseDesign, VibrationModel
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.hysteresis.loops_fit import (
    LoopFit,
    LoopModel,
    LoopRange,
    LoopRecord,
    NormalEquations,
    cell_count,
    fit_loops,
    roughness,
    side,
    solve,
    surface_of,
    swept_areas,
)
from afm_scan_ros.core.types import Array

LOWER, UPPER = -1.0, 2.5
SAMPLE_PERIOD = 5e-3
NOISE = 70e-9  # m rms
CELLS = 5

weights_of_cells = arrays(np.float64, cell_count(CELLS), elements=st.floats(0.01, 1.0))
drives = arrays(np.float64, st.integers(1, 60), elements=st.floats(LOWER, UPPER))


@given(weights_of_cells, drives)
@settings(deadline=None)
def test_weights_times_areas_are_the_walk_along_their_surface(weights: Array, drive: Array) -> None:
    model = Preisach(surface_of(weights, LOWER, UPPER, offset=0.3))
    walked = model.apply(model.saturated(), drive)[1]
    areas = swept_areas(drive, LOWER, UPPER, CELLS)
    np.testing.assert_allclose(0.3 + areas @ weights, walked, rtol=0.0, atol=1e-11)


@given(drives)
@settings(deadline=None)
def test_no_cell_is_switched_by_less_than_nothing_or_more_than_all(drive: Array) -> None:
    areas = swept_areas(drive, LOWER, UPPER, CELLS)
    assert areas.min() >= -1e-12
    assert areas.max() <= 2.0 + 1e-12
    full = swept_areas(np.array([UPPER, LOWER]), LOWER, UPPER, CELLS)
    np.testing.assert_allclose(full, [[2.0] * len(full[0]), [0.0] * len(full[0])], atol=1e-12)


def test_a_drive_out_of_the_range_is_refused() -> None:
    with pytest.raises(BeyondRangeError, match=r"sample 1 of the block: 2\.6 V is beyond"):
        swept_areas(np.array([0.0, 2.6]), LOWER, UPPER, CELLS)


@given(st.integers(1, 200))
def test_side_undoes_the_count(cells: int) -> None:
    assert side(cell_count(cells)) == cells


def test_an_even_density_is_not_rough_and_every_other_is() -> None:
    form = roughness(CELLS)
    on_diagonal = np.eye(CELLS)[np.tril_indices(CELLS)]
    assert np.ones(len(form)) @ form @ np.ones(len(form)) == pytest.approx(0.0, abs=1e-9)
    assert on_diagonal @ form @ on_diagonal == pytest.approx(0.0, abs=1e-9)
    assert np.linalg.matrix_rank(form) == len(form) - 2


def test_weights_are_found_where_the_areas_tell_them_apart() -> None:
    rng = np.random.default_rng(0)
    areas = rng.uniform(0.0, 2.0, (200, cell_count(CELLS)))
    weights = rng.uniform(0.1, 1.0, cell_count(CELLS))
    weights[1] = 0.0  # at the bound
    found = solve(NormalEquations.of(areas, areas @ weights), smoothing=0.0)
    np.testing.assert_allclose(found, weights, rtol=0.0, atol=1e-7)


def truth() -> LoopModel:
    """Hysteresis of random density, a lag of 12 ms, 3 % of creep in 8 s; displacement in m."""
    rng = np.random.default_rng(1)
    cells = 9  # in none of the grids that are fitted
    density = rng.uniform(0.2, 1.0, (cells, cells)) + 6.0 * np.eye(cells)
    weights = density[np.tril_indices(cells)]
    surface = surface_of(weights / weights.sum(), LOWER, UPPER, offset=0.0)
    lag = VibrationModel((20e-6 / (surface.output_upper - surface.output_lower),), (0.012, 1.0))
    return LoopModel(surface, lag, CreepModel((0.03,), (8.0,)), SAMPLE_PERIOD)


TRUTH = truth()


def measured(drive: Array, seed: int) -> Array:
    """Displacement from negative saturation, m, with the sensor's noise."""
    return TRUTH.apply(drive) + np.random.default_rng(seed).normal(0.0, NOISE, len(drive))


def swinging(seconds: float, envelope: Array) -> Array:
    """Drive that swings at 1 Hz about the middle; the envelope from 0 to 1 at equal times."""
    time = np.arange(0.0, seconds, SAMPLE_PERIOD)
    size = np.interp(time, np.linspace(0.0, seconds, len(envelope)), envelope)
    middle, half = 0.5 * (LOWER + UPPER), 0.5 * (UPPER - LOWER)
    return np.asarray(middle + half * size * np.sin(2.0 * np.pi * time))


TEACHES = swinging(30.0, np.array([1.0, 1.0, 0.1, 0.9]))
FRESH = swinging(20.0, np.array([0.9, 0.2, 0.7, 0.1, 0.8]))
ORIGIN = -96e-6  # m


@pytest.fixture(scope="module")
def fit() -> LoopFit:
    half = len(TEACHES) // 2
    fitted = (slice(200, half), slice(half, None))
    record = LoopRecord(TEACHES, ORIGIN + measured(TEACHES, 2), fitted)
    return fit_loops([record], SAMPLE_PERIOD, LoopRange(LOWER, UPPER, cells=20))


def test_what_taught_is_fitted_to_the_noise(fit: LoopFit) -> None:
    assert fit.fitted == pytest.approx(NOISE, rel=0.1)
    assert fit.fitted < fit.crossed


def test_lag_and_creep_are_found(fit: LoopFit) -> None:
    assert fit.model.vibration.denominator[0] == pytest.approx(0.012, rel=0.1)
    assert fit.model.creep.gains[0] == pytest.approx(0.03, rel=0.3)


def test_fresh_loops_are_predicted_close_to_the_noise(fit: LoopFit) -> None:
    error = fit.model.apply(FRESH) - TRUTH.apply(FRESH)
    assert np.std(error[200:]) < NOISE


def test_the_inverse_drives_the_truth_along_the_path(fit: LoopFit) -> None:
    design = InverseDesign(SmoothWeight(corner=30.0, order=2), preview=0.2)
    path = fit.model.apply(FRESH)
    drive = fit.model.invert(path, design)
    assert len(drive) == len(path)
    error = TRUTH.apply(drive) - path
    assert np.std(error[200:]) < 2.0 * NOISE


def test_one_stretch_is_refused() -> None:
    record = LoopRecord(TEACHES, TEACHES, (slice(None),))
    with pytest.raises(InputError, match="1 stretch to learn from; give two or more"):
        fit_loops([record], SAMPLE_PERIOD, LoopRange(LOWER, UPPER))


@pytest.mark.parametrize(
    ("displacement", "fitted", "says"),
    [
        (TEACHES[1:], slice(None), "samples of drive, 5999 of displacement"),
        (np.where(np.arange(6000) == 7, np.nan, TEACHES), slice(None), "sample 7 is not finite"),
        (TEACHES, slice(7000, 8000), "rests from sample 7000 to 8000"),
        (np.zeros(6000), slice(0, 100), "rests from sample 0 to 100"),
    ],
)
def test_a_record_that_cannot_teach_is_refused(
    displacement: Array, fitted: slice, says: str
) -> None:
    with pytest.raises(InputError, match=says):
        LoopRecord(TEACHES, displacement, (fitted,))
