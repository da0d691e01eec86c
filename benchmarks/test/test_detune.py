"""A detuned plant has its resonance or its creep elsewhere and is otherwise the same."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from afm_scan_bench.detune import detuned, with_creep_rate
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.simulation.axis import highest_peak
from afm_scan_ros.simulation.scanner import PlantSpec

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
        assert after.creep == before.creep
        peaks = [
            [m.relative_peak * highest_peak(s.vibration) for m in s.modes] for s in (before, after)
        ]
        np.testing.assert_allclose(*peaks, rtol=1e-12)


@settings(deadline=None)
@given(factor=st.floats(0.2, 5.0))
def test_only_the_creep_hurries(plant: PlantSpec, factor: float) -> None:
    hurried = with_creep_rate(plant, factor)
    for before, after in ((plant.x, hurried.x), (plant.y, hurried.y)):
        for side in ("numerator", "denominator"):
            old, new = (np.sort(np.roots(getattr(each.creep, side))) for each in (before, after))
            np.testing.assert_allclose(new, factor * old, rtol=1e-6)
        (b, a), (d, c) = ((e.creep.numerator, e.creep.denominator) for e in (before, after))
        assert d[-1] / c[-1] == pytest.approx(b[-1] / a[-1], rel=1e-12)
        assert after.vibration == before.vibration


def test_a_negative_damping_is_refused(plant: PlantSpec) -> None:
    with pytest.raises(InputError, match="unstable"):
        detuned(plant, 1.0, -1.0)
