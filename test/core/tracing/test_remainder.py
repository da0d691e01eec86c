"""How much a name may leave of what it explains."""

import numpy as np
import pytest

from afm_scan_ros.core.tracing.remainder import AMISS, LOUD, REMAINDER, too_much

QUIET = np.ones(3)


def left(ratio: float) -> list[np.ndarray]:
    """Two records, of which one has one band above its floor."""
    return [QUIET, np.array([ratio, 1.0, 0.5])]


@pytest.mark.parametrize("ratio", [1.0, 0.99 * LOUD])
def test_what_is_hardly_above_the_floor_is_never_too_much(ratio: float) -> None:
    assert not too_much(left(ratio), explained=1e-3)


@pytest.mark.parametrize("ratio", [1.01 * LOUD, 0.99 * AMISS])
def test_what_is_loud_must_be_small_beside_what_is_explained(ratio: float) -> None:
    enough = (ratio**2 - 1.0) / REMAINDER
    assert too_much(left(ratio), 0.99 * enough)
    assert not too_much(left(ratio), 1.01 * enough)


def test_no_explanation_excuses_a_band_that_is_far_above_its_floor() -> None:
    assert too_much(left(1.01 * AMISS), explained=1e9)
