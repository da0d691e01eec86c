"""Factors of gain, resonance and creep that one recording tells, beside the truth."""

from functools import cache

import numpy as np
import pytest

from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.diagnosis.evidence import Evidence
from afm_scan_ros.core.diagnosis.preparation import evidence_of
from afm_scan_ros.core.diagnosis.settings import LIMIT
from afm_scan_ros.core.effects.parameter_shift import insert_creep, insert_gain, insert_resonance
from afm_scan_ros.core.record import Record
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.scanner import chain_of
from afm_scan_ros.core.types import Trace
from afm_scan_ros.features.survey.recording import QuantityEstimate, estimates
from helpers.in_process import ALL, FAST_SPEC, default_model, scan

SLOW = ScanSpec(
    pattern="sinusoidal",
    preparation="none",
    line_rate=1.0,
    lines=4,
    samples_per_line=10_000,
    approach=1.0,
    settle=1.0,
)


def changed(chain: Chain, factors: dict[str, float]) -> Chain:
    chain = insert_gain(chain, np.array([factors.get("gain", 1.0)]))
    moved = np.array([factors.get("resonance", 1.0), factors.get("damping", 1.0)])
    return insert_creep(insert_resonance(chain, moved), np.array([factors.get("creep", 1.0), 1.0]))


@cache
def evidence(spec: ScanSpec) -> Evidence:
    made = scan(spec, ALL)
    return evidence_of(
        "x", default_model(), Record.of_traces("scan", made.drive, made.measured, spec)
    )


def told(
    factors: dict[str, float], seed: int = 1, spec: ScanSpec = FAST_SPEC
) -> dict[str, QuantityEstimate]:
    """What a scanner shows that is its model with other factors, and its sensor's noise."""
    chain = chain_of(default_model().axis("x"))
    before = evidence(spec)
    moved = before.playback.displacement(changed(chain, factors))
    size = np.linalg.norm(before.limit.noise)
    moved = moved + size * np.random.default_rng(seed).standard_normal(len(moved))
    still, period = np.zeros_like(moved), before.playback.view.sample_period
    drive = Trace(0, period, before.playback.view.drive, still)
    observed = Record.of_traces("made", drive, Trace(0, period, moved, still), spec)
    found = evidence_of("x", default_model(), observed)
    return {each.name: each for each in estimates(found, chain)}


@pytest.mark.parametrize(
    "factors",
    [{}, {"gain": 1.03}, {"creep": 1.4}, {"resonance": 0.95}, {"resonance": 1.02, "damping": 1.3}],
    ids=str,
)
def test_the_factors_are_found_within_their_intervals(factors: dict[str, float]) -> None:
    found = told(factors)
    for name in ("gain", "resonance", "damping", "creep"):
        low, high = found[name].interval
        assert low <= factors.get(name, 1.0) <= high
    assert found["gain"].value == pytest.approx(factors.get("gain", 1.0), rel=2e-3)
    assert found["resonance"].value == pytest.approx(factors.get("resonance", 1.0), rel=5e-3)


@pytest.mark.evidence
def test_noise_scatters_the_estimates_as_stated() -> None:
    some = [told({}, seed) for seed in range(12)]
    for name in ("gain", "resonance", "damping", "residual_ratio"):
        logs = np.log([each[name].value for each in some])
        assert 0.5 < logs.std(ddof=1) / some[0][name].noise < 2.0, name


def test_a_model_that_fits_leaves_less_than_its_limit_and_a_change_leaves_more() -> None:
    assert told({})["residual_ratio"].value < 1.0
    assert told({"gain": 1.03})["residual_ratio"].value > LIMIT.expected


def test_what_a_recording_does_not_tell_is_left_out() -> None:
    """A sine of one line a second hardly excites the resonance; its damping is not seen."""
    found = told({}, spec=SLOW).keys()
    assert {"gain", "residual_ratio"} <= found
    assert "damping" not in found
