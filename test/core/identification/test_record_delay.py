"""A record's delay is distinguished from what poles and a mode beyond the band delay."""

import numpy as np
import pytest
from attrs import evolve
from hypothesis import given, settings
from hypothesis import strategies as st

from afm_scan_ros.core.effects.vibration import VIBRATION_X, VibrationModel, held
from afm_scan_ros.core.identification.findings import UnmodelledDelay
from afm_scan_ros.core.identification.fit_report import VibrationChecks
from afm_scan_ros.core.identification.vibration.line_response import FrequencyResponse
from afm_scan_ros.core.identification.vibration.rational_fit import RationalFit, fit_rational
from afm_scan_ros.core.identification.vibration.structure import record_delay

PERIOD, RESONANCE = 2e-5, 453.936
OMEGA = 2.0 * np.pi * np.arange(4.0, 1000.0, 4.0)
OWN = 1e-6
"""s that Eq. 5's own zeros may be taken for."""


def mode(frequency: float, damping: float, peak: float) -> VibrationModel:
    omega = 2.0 * np.pi * frequency
    gain = peak * VIBRATION_X.static_gain
    return VibrationModel((gain * omega**2,), (1.0, 2.0 * damping * omega, omega**2))


def response(delay: float, seed: int = 0, noise: float = 1e-4) -> FrequencyResponse:
    """Eq. 5 with a mode at 1390 Hz, behind the hold, late, with relative noise."""
    parts = held(VIBRATION_X, PERIOD), held(mode(1390.0, 0.004, 0.02), PERIOD)
    clean = sum(part.response(OMEGA) for part in parts) * np.exp(-1j * OMEGA * delay)
    rng = np.random.default_rng(seed)
    scatter = noise * np.abs(clean)
    errors = rng.standard_normal((2, len(OMEGA))) / np.sqrt(2.0)
    noisy = clean + scatter * (errors[0] + 1j * errors[1])
    return FrequencyResponse(OMEGA, noisy, scatter, scatter, np.ones(len(OMEGA)))


@pytest.mark.evidence
@settings(deadline=None, max_examples=4)
@given(delay=st.floats(-5e-5, 3e-3), seed=st.integers(0, 9))
def test_delay_is_found_within_a_microsecond(delay: float, seed: int) -> None:
    found = record_delay(response(delay, seed), PERIOD, RESONANCE)
    assert found.delay == pytest.approx(delay, abs=OWN)
    low, high = found.interval
    assert low - OWN <= delay <= high + OWN
    assert high - low < 5e-6


def test_a_rational_model_takes_a_delay_in_silence() -> None:
    """Which is why the delay needs a model of its own."""
    late, due = (
        fit_rational(response(delay), PERIOD, VIBRATION_X.static_gain) for delay in (2e-5, 0.0)
    )
    assert late.misfit < 1.5 * due.misfit


def checks_of(delay: float) -> tuple[VibrationChecks, RationalFit]:
    measured = response(delay)
    fit = fit_rational(measured, PERIOD, VIBRATION_X.static_gain)
    return VibrationChecks({}, None, None, record_delay(measured, PERIOD, RESONANCE)), fit


@pytest.mark.parametrize("delay", [2e-5, 4e-4])
def test_a_late_record_is_found_and_how_late(delay: float) -> None:
    checks, fit = checks_of(delay)
    (found,) = checks.delay_findings(fit)
    assert found == UnmodelledDelay(pytest.approx(delay, abs=OWN), checks.delay.interval)


def test_a_model_that_has_the_delay_is_warned_of_nothing() -> None:
    checks, fit = checks_of(4e-4)
    assert not list(checks.delay_findings(evolve(fit, model=evolve(fit.model, delay=4e-4))))


def test_a_record_in_time_is_not_spoken_of() -> None:
    checks, fit = checks_of(0.0)
    assert list(checks.delay_findings(fit)) == []
