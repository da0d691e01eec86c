"""The likelihood of a residual is Student's t in each cell, and states what it leaves."""

import numpy as np
import pytest
from attrs import evolve
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.stats import multivariate_t

from afm_scan_ros.core.diagnosis.discrepancy import MotionByBand
from afm_scan_ros.core.diagnosis.evidence import Evidence
from afm_scan_ros.core.diagnosis.likelihood import CellFit, Likelihood
from afm_scan_ros.core.diagnosis.preparation import evidence_of
from afm_scan_ros.core.diagnosis.records import Playback
from afm_scan_ros.core.diagnosis.settings import VARIANCE
from afm_scan_ros.core.diagnosis.variance import log_density
from afm_scan_ros.core.effects.registry import effect_type
from afm_scan_ros.core.record import Record
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.scanner import chain_of
from helpers.in_process import ALL, default_model, scan

SIZES = st.floats(1e-4, 1e4)
SPEC = ScanSpec(line_rate=20.0, lines=6, samples_per_line=500)
CHAIN = chain_of(default_model().x)
KNOWN, FEW = np.array(VARIANCE.known), np.array(VARIANCE.freedom)


def bands(*ratios: float, known: float = VARIANCE.known) -> CellFit:
    """Bands of so many times the healthy residual's mean square."""
    count = len(ratios)
    return CellFit(np.array(ratios), *np.outer((1.0, known, VARIANCE.freedom), np.ones(count)), 0.0)


def test_the_density_is_student_s() -> None:
    """Against scipy's, in two dimensions."""
    amplitudes = np.array([[0.3, -0.2], [2.0, 1.0], [0.0, 30.0]])
    powers, variances = np.mean(amplitudes**2, axis=1), np.array([0.1, 1.0, 7.0])
    own = log_density(powers, variances, np.array(5.0), np.array(2.0))
    known = [
        multivariate_t.logpdf(a, shape=v * np.eye(2), df=5.0)
        for a, v in zip(amplitudes, variances, strict=True)
    ]
    np.testing.assert_allclose(own - own[0], np.array(known) - known[0], rtol=1e-9)


@given(less=SIZES, more=SIZES, variance=SIZES)
def test_a_smaller_residual_is_likelier(less: float, more: float, variance: float) -> None:
    less, more = sorted((less, more))
    one, other = (
        float(log_density(np.array(p), np.array(variance), KNOWN, FEW)) for p in (less, more)
    )
    assert one >= other


@given(power=SIZES, variance=SIZES, scale=SIZES)
def test_no_unit_matters(power: float, variance: float, scale: float) -> None:
    """The same in other units: the density changes by the same for every residual."""
    here = log_density(np.array([power, 0.0]), np.array(variance), KNOWN, FEW)
    there = log_density(scale * np.array([power, 0.0]), scale * np.array(variance), KNOWN, FEW)
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


def test_an_error_of_untested_motion_may_be_far_larger(evidence: Evidence) -> None:
    """A mean square that lacks an effect beside a tested error does not beside another one."""
    moved = MotionByBand(1e-6, 1.0, 10.0)
    untested = Evidence(evidence.playback, evidence.limit, moved).variance.known
    assert np.all(untested < evidence.variance.known)
    assert not bands(1.0, 30.0).adequate
    assert bands(1.0, 30.0, known=untested[0]).adequate


@pytest.fixture(scope="module")
def evidence() -> Evidence:
    done = scan(SPEC, ALL)
    moved = evolve(done.measured, x=done.measured.x + 0.1 * done.true.x)
    found = evidence_of("x", default_model(), Record.of_traces("scan", done.drive, moved, SPEC))
    return Evidence(found.playback, found.limit)


def test_an_effect_s_formula_need_not_be_exact(evidence: Evidence) -> None:
    """A gain that leaves a twentieth of itself is likelier than without this allowance."""
    chain = effect_type("parameter_shift").form("gain").insert(CHAIN, np.array([1.095]))
    found = Likelihood((evidence,), CHAIN).fit(chain)
    known = evidence.variance.total
    healthy, none = (log_density(p, known, KNOWN, FEW) for p in (found.power, 0.0 * known))
    assert found.log_likelihood > np.sum(healthy - none) + 5.0
    assert np.all(found.variance >= known)


def test_least_squares_follow_the_likelihood(evidence: Evidence) -> None:
    """Weights make its gradient that of the likelihood in each cell's mean square."""
    whole = Likelihood((evidence,), CHAIN)
    fit = whole.fit(CHAIN)
    (weighted,) = whole.reweighted(fit)
    step = 1e-6 * fit.power
    slope = (
        log_density(fit.power + step, fit.variance, fit.known, fit.freedom)
        - log_density(fit.power, fit.variance, fit.known, fit.freedom)
    ) / step
    np.testing.assert_allclose(slope, -0.5 * weighted.weights, rtol=1e-3)


def test_something_unknown_is_likelier_the_larger_the_residual(evidence: Evidence) -> None:
    """Relative to no effect, of which it has the likelihood at least once over all bands."""
    view, predicted = evidence.playback.view, evidence.playback.displacement(CHAIN)
    gains = []
    for share in (0.0, 0.01, 0.1, 1.0):
        measured = predicted + share * (view.measured - predicted)
        seen = evolve(evidence, playback=Playback(evolve(view, measured=measured)))
        whole = Likelihood((seen,), CHAIN)
        gains.append(whole.outside() - whole.fit(CHAIN).log_likelihood)
    assert gains == sorted(gains)
    assert -5.0 < gains[0] < 0.0
    assert gains[-1] > 10.0


def test_the_evidence_of_something_unknown_is_its_integral(evidence: Evidence) -> None:
    """Against quadrature over the share of the bands and the size in each."""
    whole = Likelihood((evidence,), CHAIN)
    found, motion = whole.fit(CHAIN), float(np.var(evidence.playback.view.measured))
    zero = log_density(0.0 * found.power, found.variance, KNOWN, FEW).sum()

    def there(band: int) -> float:
        power, variance = found.power[band], found.variance[band]
        span = np.log(motion / variance)

        def density(size: float) -> float:
            return float(np.exp(log_density(power, variance * (1.0 + np.exp(size)), KNOWN, FEW)))

        return quad(density, 0.0, span, limit=200)[0] / span

    here = np.exp(log_density(found.power, found.variance, KNOWN, FEW))
    sizes = np.array([there(band) for band in range(len(here))])

    def mixed(share: float) -> float:
        return float(np.exp(np.sum(np.log((1.0 - share) * here + share * sizes)) - zero + 50.0))

    expected = np.log(quad(mixed, 0.0, 1.0)[0]) - 50.0
    assert whole.outside() == pytest.approx(expected, abs=0.1)
