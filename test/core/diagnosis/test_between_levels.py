"""A smooth surface through a table's values tells how far the table may be off between them."""

import numpy as np
from scipy.interpolate import interpn

from afm_scan_ros.core.diagnosis.discrepancy import FINER, smooth
from afm_scan_ros.core.effects.hysteresis.everett import EverettSurface

LEVELS = 21
FINE = FINER * (LEVELS - 1) + 1


def _table(size: int, curvature: float) -> EverettSurface:
    """Domains that are fewer away from the middle, and as much again that yields at once."""
    alpha, beta = np.meshgrid(*2 * [np.linspace(-1.0, 1.0, size)], indexing="ij")
    way = alpha - beta
    values = way * (1.0 + curvature * way * np.cos(alpha + beta))
    return EverettSurface(-1.0, 1.0, np.tril(values), 0.0)


def test_it_goes_through_the_values() -> None:
    table = _table(LEVELS, 0.3)
    np.testing.assert_allclose(smooth(table).values[::FINER, ::FINER], table.values, atol=1e-12)


def test_a_table_without_curvature_leaves_nothing_open() -> None:
    np.testing.assert_allclose(
        smooth(_table(LEVELS, 0.0)).values, _table(FINE, 0.0).values, atol=1e-12
    )


def test_it_is_nearer_to_the_truth_than_what_is_read_straight() -> None:
    """Straight pieces are off by the square of the levels' distance, cubic ones by its fourth."""
    table, truth = _table(LEVELS, 0.3), _table(FINE, 0.3)
    points = np.tril_indices(FINE)
    places = np.column_stack([truth.levels[index] for index in points])
    odd = table.values - table.values.T
    straight = interpn((table.levels, table.levels), odd, places)
    smoothly = smooth(table).values[points]
    errors = [np.std(read - truth.values[points]) for read in (straight, smoothly)]
    assert errors[1] < 0.1 * errors[0]
