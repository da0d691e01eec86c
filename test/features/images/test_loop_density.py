"""Loops in images of gratings: the areas against the walk, the density against a truth."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from afm_scan_ros.core.effects.hysteresis.everett import BeyondRangeError
from afm_scan_ros.core.effects.hysteresis.preisach import Preisach
from afm_scan_ros.core.types import Array
from afm_scan_ros.features.images.loops.density import (
    CellGrid,
    NormalEquations,
    cell_count,
    roughness,
    side,
    solve,
    surface_of,
    swept_areas,
)
from afm_scan_ros.features.images.loops.moving import ROWS, MovingRecord, swept

LOWER, UPPER = -1.0, 2.5
SAMPLE_PERIOD = 5e-3
NOISE = 70e-9  # m rms
CELLS = 5
GRID = CellGrid(LOWER, UPPER, CELLS)

weights_of_cells = arrays(np.float64, cell_count(CELLS), elements=st.floats(0.01, 1.0))
drives = arrays(np.float64, st.integers(1, 60), elements=st.floats(LOWER, UPPER))


@given(weights_of_cells, drives)
@settings(deadline=None)
def test_weights_times_areas_are_the_walk_along_their_surface(weights: Array, drive: Array) -> None:
    model = Preisach(surface_of(weights, GRID, offset=0.3))
    walked = model.apply(model.saturated(), drive)[1]
    areas = swept_areas(drive, GRID)
    np.testing.assert_allclose(0.3 + areas @ weights, walked, rtol=0.0, atol=1e-11)


@given(weights_of_cells, drives, drives, st.integers(1, 5))
@settings(deadline=None)
def test_rows_are_means_of_what_follows_what_was_before(
    weights: Array, before: Array, drive: Array, every: int
) -> None:
    both = swept_areas(np.concatenate([before, drive]), GRID)[len(before) :]
    whole = len(drive) // every
    means = both[: whole * every].reshape(whole, every, len(weights)).mean(axis=1)
    np.testing.assert_allclose(swept_areas(drive, GRID, before, every), means, atol=1e-11)


@given(drives)
@settings(deadline=None)
def test_no_cell_is_switched_by_less_than_nothing_or_more_than_all(drive: Array) -> None:
    areas = swept_areas(drive, GRID)
    assert areas.min() >= -1e-12
    assert areas.max() <= 2.0 + 1e-12
    full = swept_areas(np.array([UPPER, LOWER]), GRID)
    np.testing.assert_allclose(full, [[2.0] * len(full[0]), [0.0] * len(full[0])], atol=1e-12)


def test_a_drive_out_of_the_range_is_refused() -> None:
    with pytest.raises(BeyondRangeError, match=r"sample 1 of the block: 2\.6 V is .* beyond"):
        swept_areas(np.array([0.0, 2.6]), GRID)


@given(st.integers(1, 200))
def test_side_undoes_the_count(cells: int) -> None:
    assert side(cell_count(cells)) == cells


def test_an_even_density_is_not_rough_and_every_other_is() -> None:
    form = roughness(CELLS)
    on_diagonal = np.eye(CELLS)[np.tril_indices(CELLS)]
    assert np.ones(len(form)) @ form @ np.ones(len(form)) == pytest.approx(0.0, abs=1e-9)
    assert on_diagonal @ form @ on_diagonal == pytest.approx(0.0, abs=1e-9)
    assert np.linalg.matrix_rank(form) == len(form) - 2


def test_weights_are_found_where_the_areas_separate_them() -> None:
    rng = np.random.default_rng(0)
    areas = rng.uniform(0.0, 2.0, (200, cell_count(CELLS)))
    weights = rng.uniform(0.1, 1.0, cell_count(CELLS))
    weights[1] = 0.0  # at the bound
    found = solve(NormalEquations.of(areas, areas @ weights, len(areas)), smoothing=0.0)
    np.testing.assert_allclose(found, weights, rtol=0.0, atol=1e-7)


@given(st.lists(st.tuples(st.integers(1_000, 9_000), st.integers(50, 900)), min_size=1, max_size=3))
@example([(5121, 50), (7369, 50), (7511, 244)])
@settings(deadline=None, max_examples=25)
def test_each_sample_counts_once(sizes: list[tuple[int, int]]) -> None:
    """Also where the first swings are shown again, in finer rows.

    A record loses less than a row at its end and half a row where the finer rows end.
    """
    waves = [np.sin(2.0 * np.pi * np.arange(n) / period) for n, period in sizes]
    records = [
        MovingRecord(str(k), w, w, SAMPLE_PERIOD, np.ones(len(w), bool))
        for k, w in enumerate(waves)
    ]
    rows = list(swept(records, CellGrid(LOWER, UPPER, 2)))
    for record in records:
        rows_of_record = [one for one in rows if one.record.name == record.name]
        counted = sum(float(one.samples.sum()) for one in rows_of_record)
        seen = min(len(record.drive), ROWS * rows_of_record[0].every)
        assert abs(counted - seen) <= 1.5 * sum(one.every for one in rows_of_record)
