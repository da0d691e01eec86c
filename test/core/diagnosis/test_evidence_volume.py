"""The evidence of Laplace's method is the integral of the likelihood over the prior."""

import numpy as np
import pytest
from attrs import evolve
from scipy.special import logsumexp

from afm_scan_ros.core.diagnosis.candidates import Candidate, CandidateFitter, InitialFit
from afm_scan_ros.core.diagnosis.fit import ParameterLayout, inserted
from afm_scan_ros.core.diagnosis.preparation import evidence_of
from afm_scan_ros.core.diagnosis.records import Observation
from afm_scan_ros.core.effects.registry import effect_type
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.scanner import chain_of
from helpers.in_process import ALL, default_model, scan

SPEC = ScanSpec(line_rate=20.0, lines=6, samples_per_line=500)
CHAIN = chain_of(default_model().x)


@pytest.mark.parametrize("change", [0.005, 0.02, 0.1])
def test_of_a_gain(change: float) -> None:
    """Where the formula may be inexact the posterior is wider, and both are integrated."""
    done = scan(SPEC, ALL)
    moved = evolve(done.measured, x=done.measured.x + change * done.true.x)
    evidence = evidence_of("x", default_model(), Observation("scan", done.drive, moved, SPEC))
    fitter = CandidateFitter((evidence,), CHAIN)
    effect = effect_type("parameter_shift")
    form = effect.form("gain")
    begun = InitialFit((Candidate(effect, form),), np.array([[1.0 + change]]), 0.0)
    trial = fitter.fit(begun)
    assert trial is not None
    (value,), half = trial.fit.values, float(trial.fit.halfwidth[0])
    gains = value + half * np.linspace(-6.0, 6.0, 241)
    chains = (inserted(CHAIN, [form], np.array([[gain]])) for gain in gains)
    logs = [fitter.likelihood.fit(chain).log_likelihood for chain in chains]
    (width,) = ParameterLayout([form], 1).prior_widths(np.array([value]), fitter.span)
    density = 1.0 / (np.sqrt(2.0 * np.pi) * width)
    exact = logsumexp(logs) + np.log(density * (gains[1] - gains[0]))
    assert trial.bands.log_likelihood + trial.fit.log_volume == pytest.approx(exact, abs=0.1)
