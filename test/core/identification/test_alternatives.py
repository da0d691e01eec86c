"""Intervals reach as far as the other descriptions of a record do, and the scatter beyond."""

import numpy as np
import pytest
from attrs import evolve
from hypothesis import given, settings
from hypothesis import strategies as st

from afm_scan_ros.core.effects.vibration import VIBRATION_X, held
from afm_scan_ros.core.identification.statuses import spanning
from afm_scan_ros.core.identification.vibration.line_response import FrequencyResponse
from afm_scan_ros.core.identification.vibration.rational_fit import RationalFit, fit_rational

OMEGA = 2.0 * np.pi * np.arange(8.0, 1000.0, 8.0)
SHIFTS = st.lists(st.floats(-1e-3, 1e-3), min_size=0, max_size=3)


def noisy_fit() -> RationalFit:
    rng = np.random.default_rng(0)
    clean = held(VIBRATION_X, 2e-5).response(OMEGA)
    errors = rng.standard_normal((2, len(OMEGA)))
    measured = clean * (1.0 + 1e-3 * (errors[0] + 1j * errors[1]))
    scatter = 1e-3 * np.sqrt(2.0) * np.abs(clean)
    response = FrequencyResponse(OMEGA, measured, scatter, scatter, np.ones(len(OMEGA)))
    return fit_rational(response.up_to(800.0), 2e-5, VIBRATION_X.static_gain)


FIT = noisy_fit()


def shifted(frequency: float = 1.0, damping: float = 1.0) -> RationalFit:
    """FIT with its resonance's frequency and damping ratio multiplied."""
    poles = np.roots(FIT.model.denominator)
    own = np.isclose(np.abs(poles), 2.0 * np.pi * FIT.resonance, rtol=1e-6)
    omega = 2.0 * np.pi * FIT.resonance * frequency
    pair = [1.0, 2.0 * FIT.damping * damping * omega, omega**2]
    denominator = np.polymul(np.poly(poles[~own]).real, pair)
    return evolve(FIT, model=evolve(FIT.model, denominator=tuple(map(float, denominator))))


@settings(deadline=None)
@given(shifts=SHIFTS)
def test_each_description_s_own_interval_lies_within(shifts: list[float]) -> None:
    """Of equal half-width, that is; and the interval is no wider than they need."""
    others = [shifted(damping=1.0 + shift) for shift in shifts]
    low, high = spanning(FIT, others).damping_interval
    below, above = FIT.damping - FIT.damping_interval[0], FIT.damping_interval[1] - FIT.damping
    damping = [FIT.damping * (1.0 + shift) for shift in (0.0, *shifts)]
    np.testing.assert_allclose(low, min(damping) - below, rtol=1e-8)
    np.testing.assert_allclose(high, max(damping) + above, rtol=1e-8)


def test_what_the_others_agree_on_stays() -> None:
    found = spanning(FIT, [shifted(frequency=1.0 + 1.0 / FIT.resonance)])
    low, high = FIT.resonance_interval
    assert found.resonance_interval == pytest.approx((low, high + 1.0), rel=1e-9)


def test_another_mode_that_peaks_higher_widens_nothing() -> None:
    other = evolve(FIT, resonance=2.0 * FIT.resonance, damping=0.5 * FIT.damping)
    found = spanning(FIT, [other])
    assert found.resonance_interval == pytest.approx(FIT.resonance_interval, rel=1e-9)
    assert found.damping_interval == pytest.approx(FIT.damping_interval, rel=1e-6)
    assert found.gain_interval == pytest.approx(FIT.gain_interval, rel=1e-12)
    assert found.model == FIT.model


def test_a_gain_that_a_pole_below_all_lines_may_change_is_open() -> None:
    slow = np.poly([-2.0 * np.pi * 0.5 * FIT.band[0]])
    denominator = tuple(map(float, np.polymul(FIT.model.denominator, slow)))
    other = evolve(FIT, model=evolve(FIT.model, denominator=denominator), gain_ratio=1e4)
    found = spanning(FIT, [other])
    assert found.gain_interval == (-np.inf, np.inf)
    assert found.resonance_interval == pytest.approx(FIT.resonance_interval, rel=1e-9)
