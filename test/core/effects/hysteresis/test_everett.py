"""The Everett surface: what is refused, and the figures it states."""

import numpy as np
import paper
import pytest

from afm_scan_ros.core.effects.hysteresis.everett import (
    BeyondRangeError,
    EverettSurface,
    refuse_beyond,
    rounded_into,
)
from afm_scan_ros.core.errors import InputError, ScanError

WEIGHTS = paper.cell_weights(6, seed=0)
SURFACE = paper.surface_of(WEIGHTS, -4.0, 4.0, 5.5)


def test_ends_and_chord() -> None:
    assert (SURFACE.output_lower, SURFACE.output_upper) == pytest.approx((-5.5, 5.5))
    assert SURFACE.chord == pytest.approx(5.5 / 4.0)
    assert SURFACE.levels == pytest.approx([-4.0, -2.4, -0.8, 0.8, 2.4, 4.0])


@pytest.mark.parametrize(
    ("changes", "names"),
    [
        ({(3, 1): 99.0}, "grow with alpha at alpha = 0.8 V"),
        ({(2, 1): 1e-3, (3, 1): 2e-3}, "as beta falls at alpha = 0.8 V, beta = -2.4 V"),
        ({(2, 2): 0.1}, "0 on the diagonal"),
        ({(3, 1): np.nan}, "finite"),
    ],
)
def test_a_surface_without_an_inverse_is_refused_with_its_place(
    changes: dict[tuple[int, int], float], names: str
) -> None:
    values = SURFACE.values.copy()
    for place, value in changes.items():
        values[place] = value
    with pytest.raises(InputError, match=names):
        EverettSurface(-4.0, 4.0, values, -5.5)


@pytest.mark.parametrize(
    ("lower", "upper", "values"),
    [(4.0, -4.0, SURFACE.values), (-4.0, 4.0, np.zeros((3, 4))), (-4.0, 4.0, np.zeros((1, 1)))],
)
def test_what_is_no_surface_is_refused(lower: float, upper: float, values: np.ndarray) -> None:
    with pytest.raises(InputError):
        EverettSurface(lower, upper, values, 0.0)


@pytest.mark.parametrize(
    "levels", [[-4.0, -1.0, 0.0, 1.0, 4.0], [-4.0, -1.0, 0.0, 0.0, 1.0, 4.0], [-4, -1, 0, 1, 2, 3]]
)
def test_levels_that_are_none_of_the_surface_are_refused(levels: list[float]) -> None:
    with pytest.raises(InputError, match="level"):
        EverettSurface(-4.0, 4.0, SURFACE.values, -5.5, uneven=levels)


@pytest.mark.parametrize(("value", "limit"), [(4.5, 4.0), (-4.5, -4.0), (np.nan, 4.0)])
def test_the_first_sample_beyond_is_named(value: float, limit: float) -> None:
    with pytest.raises(BeyondRangeError, match="sample 2 of the block") as caught:
        refuse_beyond(np.array([0.0, 4.0, value, 9.0]), -4.0, 4.0)
    assert (caught.value.sample, caught.value.limit) == (2, limit)
    assert np.array_equal(caught.value.value, value, equal_nan=True)
    assert isinstance(caught.value, ScanError)


def test_what_rounding_puts_beyond_a_limit_is_at_the_limit() -> None:
    block = np.array([-4.0 - 1e-14, 0.0, 4.0 + 1e-14, 4.1])
    assert rounded_into(block, -4.0, 4.0).tolist() == [-4.0, 0.0, 4.0, 4.1]
    with pytest.raises(BeyondRangeError):
        refuse_beyond(rounded_into(block, -4.0, 4.0), -4.0, 4.0)
