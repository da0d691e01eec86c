"""The likelihood of a residual is Student's t in each band, and states what it leaves."""

import numpy as np
import pytest
from attrs import evolve
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import multivariate_t

from afm_scan_ros.core.diagnosis import likelihood
from afm_scan_ros.core.diagnosis.evidence import Evidence
from afm_scan_ros.core.diagnosis.likelihood import BandFit, Likelihood, log_density
from afm_scan_ros.core.diagnosis.preparation import evidence_of
from afm_scan_ros.core.diagnosis.records import Observation
from afm_scan_ros.core.effects.registry import effect_type
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.scanner import chain_of
from helpers.in_process import ALL, default_model, scan

SIZES = st.floats(1e-4, 1e4)
SPEC = ScanSpec(line_rate=20.0, lines=6, samples_per_line=500)
CHAIN = chain_of(default_model().x)


def bands(*ratios: float) -> BandFit:
    """Bands of so many times the healthy residual's mean square."""
    return BandFit(np.array(ratios), np.ones(len(ratios)), 0.0)


def test_the_density_is_student_s(monkeypatch: pytest.MonkeyPatch) -> None:
    """Against scipy's, in the two dimensions that a band then has."""
    monkeypatch.setattr(likelihood, "FREEDOM", 2.0)
    monkeypatch.setattr(likelihood, "KNOWN_FREEDOM", 5.0)
    amplitudes = np.array([[0.3, -0.2], [2.0, 1.0], [0.0, 30.0]])
    powers, variances = np.mean(amplitudes**2, axis=1), np.array([0.1, 1.0, 7.0])
    own = log_density(powers, variances)
    known = [
        multivariate_t.logpdf(a, shape=v * np.eye(2), df=5.0)
        for a, v in zip(amplitudes, variances, strict=True)
    ]
    np.testing.assert_allclose(own - own[0], np.array(known) - known[0], rtol=1e-9)


@given(less=SIZES, more=SIZES, variance=SIZES)
def test_a_smaller_residual_is_likelier(less: float, more: float, variance: float) -> None:
    less, more = sorted((less, more))
    one, other = (float(log_density(np.array(p), np.array(variance))) for p in (less, more))
    assert one >= other


@given(power=SIZES, variance=SIZES, scale=SIZES)
def test_no_unit_matters(power: float, variance: float, scale: float) -> None:
    """The same in other units: the density changes by the same for every residual."""
    here = log_density(np.array([power, 0.0]), np.array(variance))
    there = log_density(scale * np.array([power, 0.0]), scale * np.array(variance))
    assert np.diff(here) == pytest.approx(np.diff(there), rel=1e-6, abs=1e-9)


def test_a_residual_as_of_healthy_scans_lacks_nothing() -> None:
    assert bands(*np.linspace(0.1, 4.0, 15)).adequate
    assert bands(1.0, 2.0).unremarkable


@pytest.mark.parametrize("large", [60.0, 1e6])
def test_a_band_that_chance_does_not_explain_is_lacking(large: float) -> None:
    found = bands(*np.ones(14), large)
    assert np.flatnonzero(found.lacking).tolist() == [14]
    assert not found.unremarkable


def test_of_many_bands_one_is_large_by_chance() -> None:
    """What is lacking among two bands is not so among thirty."""
    assert bands(1.0, 14.0).lacking[1]
    assert bands(*np.ones(29), 14.0).adequate


@pytest.fixture(scope="module")
def evidence() -> Evidence:
    done = scan(SPEC, ALL)
    moved = evolve(done.measured, x=done.measured.x + 0.1 * done.true.x)
    return evidence_of("x", default_model(), Observation("scan", done.drive, moved, SPEC))


def test_an_effect_s_formula_need_not_be_exact(evidence: Evidence) -> None:
    """A gain that leaves a twentieth of itself is likelier than without this allowance."""
    chain = effect_type("parameter_shift").form("gain").insert(CHAIN, np.array([1.095]))
    found = Likelihood((evidence,), CHAIN).fit(chain)
    known = likelihood.known_variance(evidence.limit)
    exact = np.sum(log_density(found.power, known) - log_density(np.zeros(len(known)), known))
    assert found.log_likelihood > exact + 5.0
    assert np.all(found.variance >= likelihood.known_variance(evidence.limit))


def test_least_squares_follow_the_likelihood(evidence: Evidence) -> None:
    """Weights make its gradient that of the likelihood in each band's mean square."""
    whole = Likelihood((evidence,), CHAIN)
    fit = whole.fit(CHAIN)
    (weighted,) = whole.reweighted(fit)
    step = 1e-6 * fit.power
    slope = (
        log_density(fit.power + step, fit.variance) - log_density(fit.power, fit.variance)
    ) / step
    np.testing.assert_allclose(slope, -0.5 * likelihood.FREEDOM / weighted.limit.rms**2, rtol=1e-3)
