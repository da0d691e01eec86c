"""Fits of a long record start from the decimated one."""

import numpy as np
import pytest
from attrs import evolve
from hypothesis import given, settings
from hypothesis import strategies as st

from afm_scan_ros.core.bands import rms_by_band
from afm_scan_ros.core.diagnosis import evidence
from afm_scan_ros.core.diagnosis.candidates import CANDIDATES, CandidateFitter
from afm_scan_ros.core.diagnosis.discrepancy import DetectionLimit
from afm_scan_ros.core.diagnosis.evidence import Evidence, decimated
from afm_scan_ros.core.diagnosis.preparation import evidence_of
from afm_scan_ros.core.diagnosis.records import Playback
from afm_scan_ros.core.diagnosis.settings import DECIMATION, LIMIT, DecimationSettings
from afm_scan_ros.core.effects.residual_features import ResidualFeatures
from afm_scan_ros.core.metrics import Scan
from afm_scan_ros.core.record import Record
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.scanner import chain_of
from afm_scan_ros.core.types import AXES
from afm_scan_ros.files import share_directory
from afm_scan_ros.files.plant_file import load_plant
from helpers.in_process import ALL, default_model, scan

SPEC = ScanSpec(line_rate=5.0, lines=6, samples_per_line=4000)
HOPELESS = 100.0
"""Cost (nat) beyond the best that no fit makes up for."""
SOME = ("delay", "drift", "input_lag", "rate_dependent_hysteresis", "slow_creep")
CHAINS = {axis: chain_of(default_model().axis(axis)) for axis in AXES}


@pytest.fixture(scope="module")
def healthy() -> Scan:
    return scan(SPEC, ALL)


@pytest.fixture(autouse=True)
def _six_lines_are_long(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(evidence, "DECIMATION", DecimationSettings(longest=20_000))


def evidence_for(done: Scan, axis: str = "x") -> Evidence:
    observed = Record.of_traces("record", done.drive, done.measured, SPEC)
    return evidence_of(axis, default_model(), observed)


def count(evidence: Evidence) -> int:
    return len(evidence.playback.view.drive)


def test_a_decimated_record_is_predicted_as_the_record_is(healthy: Scan) -> None:
    whole, chain = evidence_for(healthy), CHAINS["x"]
    seen = decimated(whole, chain)
    period = seen.playback.view.sample_period
    step = round(period / SPEC.sample_period)
    sampled = whole.playback.displacement(chain)[::step][: count(seen)]
    moved = seen.playback.displacement(chain) - sampled
    assert step > 1
    assert count(seen) <= evidence.DECIMATION.longest
    assert rms_by_band(moved, seen.limit.edges, period).max() > 0.0
    np.testing.assert_array_less(
        rms_by_band(moved, seen.limit.edges, period), 2.0 * DECIMATION.equal_within * seen.limit.rms
    )
    assert seen.ratio(chain).max() < LIMIT.expected


def test_a_short_record_is_not_decimated(healthy: Scan, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = evidence_for(healthy)
    monkeypatch.setattr(evidence, "DECIMATION", DecimationSettings(longest=count(whole)))
    assert CandidateFitter((whole,), CHAINS["x"]).decimated_evidence == (whole,)


@settings(max_examples=20)
@given(frequency=st.floats(1000.0, 9000.0))
def test_decimation_does_not_alias(healthy: Scan, frequency: float) -> None:
    """Of fewer than two samples a period it would be one."""
    whole = evidence_for(healthy)
    view = whole.playback.view
    time = view.sample_period * np.arange(len(view.drive))
    measured = view.measured + 2e-7 * np.sin(2.0 * np.pi * frequency * time)
    seen = decimated(evolve(whole, playback=Playback(evolve(view, measured=measured))), CHAINS["x"])
    assert 0.5 / seen.playback.view.sample_period > frequency


def test_fast_motion_is_not_decimated(healthy: Scan) -> None:
    """In six lines y takes a sixth of its whole way in each of its steps."""
    whole = evidence_for(healthy, axis="y")
    assert decimated(whole, CHAINS["y"]) is whole


@given(noise=st.floats(1e-12, 1e-9), factor=st.integers(1, 16))
def test_noise_sampled_less_often_is_as_loud_in_fewer_bands(noise: float, factor: int) -> None:
    edges = np.array([0.0, 10.0, 300.0, 1700.0, 10e3])
    white = noise * np.sqrt(np.diff(edges) / edges[-1])
    error = np.array([3e-10, 2e-10, 1e-10, 0.0])
    limit = DetectionLimit(edges, np.hypot(error, white), white, 450.0).sampled(factor * 5e-5)
    assert limit.edges[-1] == pytest.approx(10e3 / factor)
    assert np.linalg.norm(limit.noise) == pytest.approx(noise)
    selected = len(limit.rms)
    np.testing.assert_allclose(limit.rms**2 - limit.noise**2, error[:selected] ** 2, atol=1e-24)


def test_fits_start_alike_from_a_decimated_record(monkeypatch: pytest.MonkeyPatch) -> None:
    """The same candidates, by what each costs beyond the first: unseen bands cost the same.

    What of slow effects leaks between the harmonics depends on where a record ends.
    """
    plant = load_plant(share_directory() / "config/plants/delay_large.yaml")
    whole, chain = evidence_for(scan(SPEC, ALL, plant=plant)), CHAINS["x"]
    quick = begun(CandidateFitter((whole,), chain))
    monkeypatch.setattr(evidence, "DECIMATION", DecimationSettings(longest=count(whole)))
    slow = begun(CandidateFitter((whole,), chain))
    assert list(quick) == list(slow)
    assert next(iter(quick)) == ("delay", "")
    beyond = [np.array(list(each.values())) - each["delay", ""] for each in (quick, slow)]
    near = beyond[1] < HOPELESS
    np.testing.assert_allclose(beyond[0][near], beyond[1][near], rtol=0.05, atol=1.0)
    np.testing.assert_allclose(*beyond, rtol=0.25, atol=1.0)


def begun(bench: CandidateFitter) -> dict[tuple[str, str], float]:
    """Costs of some candidates by name and kind, the best first."""
    view, residual = (
        bench.decimated_evidence[0].playback.view,
        bench.decimated_evidence[0].residual(bench.chain),
    )
    features = ResidualFeatures(
        view.sample_period, view.drive, view.measured, residual, view.other, ()
    )
    tried = [bench.begin(None, each, features) for each in CANDIDATES if each.effect.name in SOME]
    found = sorted((each for each in tried if each), key=lambda each: each.cost)
    return {(b.candidates[0].effect.name, b.candidates[0].form.kind): b.cost for b in found}
