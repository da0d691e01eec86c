"""Intervals reach as far as the other descriptions of a record do, and the scatter beyond."""

import numpy as np
import pytest
from attrs import evolve
from hypothesis import given, settings
from hypothesis import strategies as st

from afm_scan_ros.core.effects.vibration import held
from afm_scan_ros.core.identification.alternatives import spanning
from afm_scan_ros.core.identification.vibration.frequency_response import FrequencyResponse
from afm_scan_ros.core.identification.vibration.rational_fit import RationalFit, fit_rational
from afm_scan_ros.core.paper import VIBRATION_X

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


@settings(deadline=None)
@given(shifts=SHIFTS)
def test_each_description_s_own_interval_lies_within(shifts: list[float]) -> None:
    """Of equal half-width, that is; and the interval is no wider than they need."""
    others = [evolve(FIT, damping=FIT.damping * (1.0 + shift)) for shift in shifts]
    low, high = spanning(FIT, others).damping_interval
    below, above = FIT.damping - FIT.damping_interval[0], FIT.damping_interval[1] - FIT.damping
    damping = [fit.damping for fit in (FIT, *others)]
    np.testing.assert_allclose(low, min(damping) - below, rtol=1e-12)
    np.testing.assert_allclose(high, max(damping) + above, rtol=1e-12)


def test_what_the_others_agree_on_stays() -> None:
    other = evolve(FIT, resonance=FIT.resonance + 1.0)
    found = spanning(FIT, [other])
    low, high = FIT.resonance_interval
    assert found.resonance_interval == pytest.approx((low, high + 1.0), rel=1e-12)
    assert found.gain_interval == pytest.approx(FIT.gain_interval, rel=1e-12)
    assert found.model == FIT.model
