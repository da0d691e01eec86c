"""How much lack of fit an effect may leave."""

import numpy as np
import pytest

from afm_scan_ros.core.diagnosis.scoring import (
    EXPLAINED_SHARE,
    LACKING,
    LARGEST_RATIO,
    lack_of_fit,
    reduction,
)
from afm_scan_ros.core.types import Array

QUIET = np.ones(3)


def record(ratio: float) -> list[Array]:
    """Two records, of which one has one band above its floor."""
    return [QUIET, np.array([ratio, 1.0, 0.5])]


def before(explained: float, left: float) -> list[Array]:
    """The same with so much more in that band."""
    return record(float(np.hypot(np.sqrt(explained), left)))


@pytest.mark.parametrize("ratio", [1.0, 0.99 * LACKING])
def test_what_is_hardly_above_the_floor_is_never_too_much(ratio: float) -> None:
    assert not lack_of_fit(before(1e-3, ratio), record(ratio))


@pytest.mark.parametrize("ratio", [1.01 * LACKING, 0.99 * LARGEST_RATIO])
def test_what_is_loud_must_be_small_beside_what_is_explained(ratio: float) -> None:
    enough = (ratio**2 - 1.0) / EXPLAINED_SHARE
    assert lack_of_fit(before(0.99 * enough, ratio), record(ratio))
    assert not lack_of_fit(before(1.01 * enough, ratio), record(ratio))


def test_no_explanation_excuses_a_band_that_is_far_above_its_floor() -> None:
    assert lack_of_fit(before(1e9, 1.01 * LARGEST_RATIO), record(1.01 * LARGEST_RATIO))


def test_what_explains_one_band_excuses_nothing_in_another() -> None:
    left = [np.array([1.0, 1.01 * LACKING, 1.0])]
    assert lack_of_fit([np.array([1e4, 1.01 * LACKING, 1.0])], left)


def test_what_became_louder_counts_as_nothing_explained() -> None:
    assert reduction([np.array([3.0, 1.0])], [np.array([1.0, 2.0])]).tolist() == [8.0, 0.0]
