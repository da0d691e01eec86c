"""A surface that does not grow is moved to one that does, no farther than it falls."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from afm_scan_ros.core.effects.hysteresis.everett import EverettSurface, grown

LEVELS, LEAST = np.linspace(-1.0, 1.0, 25), 1e-3
STRAIGHT = np.tril(0.5 * (LEVELS[:, np.newaxis] - LEVELS))


@given(seed=st.integers(0, 10_000), size=st.sampled_from([0.01, 0.05, 0.3]))
def test_a_disturbed_surface_grows_within_its_disturbance(seed: int, size: float) -> None:
    rng = np.random.default_rng(seed)
    disturbance = size * np.tril(rng.uniform(-1.0, 1.0, STRAIGHT.shape), -1)
    found, share = grown(STRAIGHT + disturbance, LEVELS, LEAST)
    EverettSurface(-1.0, 1.0, found, 0.0)
    assert share <= LEAST
    assert np.abs(found - STRAIGHT).max() <= size + share


def test_a_surface_that_grows_stays() -> None:
    found, share = grown(0.7 * STRAIGHT, LEVELS, LEAST)
    np.testing.assert_array_equal(found, 0.7 * STRAIGHT)
    assert share == pytest.approx(0.0)
