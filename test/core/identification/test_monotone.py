"""Laws of the nearest monotone surface."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from afm_scan_ros.core.effects.hysteresis.everett import EverettSurface
from afm_scan_ros.core.identification.monotone import nearest_monotone
from afm_scan_ros.core.types import Array

SIZE = 6
ROW, COLUMN = np.indices((SIZE, SIZE))
MONOTONE = np.where(ROW > COLUMN, (ROW - COLUMN) * (1.0 + 0.1 * ROW), 0.0)
DEVIATIONS = arrays(np.float64, (SIZE, SIZE), elements=st.floats(-3.0, 3.0))


@given(deviation=DEVIATIONS)
@settings(deadline=None)
def test_result_always_has_an_inverse(deviation: Array) -> None:
    found = nearest_monotone(np.where(ROW > COLUMN, MONOTONE + deviation, 0.0))
    EverettSurface(-1.0, 1.0, found, 0.0)


def test_monotone_surface_stays() -> None:
    np.testing.assert_allclose(nearest_monotone(MONOTONE), MONOTONE, atol=1e-12)


@given(deviation=DEVIATIONS)
@settings(deadline=None)
def test_no_monotone_surface_is_nearer(deviation: Array) -> None:
    values = np.where(ROW > COLUMN, np.abs(MONOTONE + deviation), 0.0)
    change = np.abs(nearest_monotone(values) - values).max()
    assert change <= np.abs(MONOTONE - values).max() + 1e-4
