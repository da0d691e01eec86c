"""A detuned plant has its resonance elsewhere and is otherwise the same."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.simulation.detune import detuned
from afm_scan_ros.simulation.spec import PlantSpec

factors = st.floats(0.9, 1.1)


@settings(deadline=None)
@given(frequency=factors, damping=factors)
def test_only_the_resonance_moves(plant: PlantSpec, frequency: float, damping: float) -> None:
    moved = detuned(plant, frequency, damping)
    for before, after in ((plant.x, moved.x), (plant.y, moved.y)):
        old, new = (np.roots(each.vibration.denominator) for each in (before, after))
        was, now = (pole[pole.imag > 0.0][0] for pole in (old, new))
        assert abs(now) == pytest.approx(frequency * abs(was), rel=1e-9)
        assert now.real / abs(now) == pytest.approx(damping * was.real / abs(was), rel=1e-7)
        np.testing.assert_allclose(np.sort(new.real)[:2], np.sort(old.real)[:2], rtol=1e-9)
        zeros = np.roots(after.vibration.numerator)
        np.testing.assert_allclose(zeros, np.roots(before.vibration.numerator), rtol=1e-9)
        gains = [s.vibration.numerator[-1] / s.vibration.denominator[-1] for s in (before, after)]
        assert gains[1] == pytest.approx(gains[0], rel=1e-12)
        assert (after.modes, after.creep) == (before.modes, before.creep)


def test_a_negative_damping_is_refused(plant: PlantSpec) -> None:
    with pytest.raises(InputError, match="unstable"):
        detuned(plant, 1.0, -1.0)
