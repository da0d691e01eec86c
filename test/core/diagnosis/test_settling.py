"""Values that are added to a model are right from the scanner's rest on."""

import numpy as np
import pytest
from attrs import evolve

from afm_scan_ros.core.diagnosis.candidates import Candidate, FittedCandidates, refit_on_all
from afm_scan_ros.core.diagnosis.evidence import Evidence
from afm_scan_ros.core.diagnosis.fit import Problem
from afm_scan_ros.core.diagnosis.preparation import evidence_of
from afm_scan_ros.core.diagnosis.records import Observation
from afm_scan_ros.core.effects.registry import effect_type
from afm_scan_ros.core.scan import Scan
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.scanner import chain_of
from afm_scan_ros.core.types import Array
from helpers.in_process import ALL, default_model, lines_of, scan

SPEC = ScanSpec(line_rate=20.0, lines=6, samples_per_line=500)
CHAIN = chain_of(default_model().x)
FORM = effect_type("drift").form("")
RATE, SETTLING = 3e-7, 10.0


@pytest.fixture(scope="module")
def healthy() -> Scan:
    return scan(SPEC, ALL)


def with_added(
    done: Scan, added: Array | float, spec: ScanSpec | None = SPEC, experiment: str | None = None
) -> Evidence:
    measured = evolve(done.measured, x=done.measured.x + added)
    observed = Observation("record", done.drive, measured, spec, experiment)
    return evidence_of("x", default_model(), observed)


def drift(done: Scan, rate: float, settling: float) -> Array:
    time = SPEC.sample_period * np.arange(len(done.drive.x))
    return np.asarray(-rate * settling * np.expm1(-time / settling))


def test_an_offset_of_the_sensor_says_nothing(healthy: Scan) -> None:
    here, there = (with_added(healthy, offset).whole(CHAIN) for offset in (0.0, 1e-6))
    np.testing.assert_allclose(here, there, atol=1e-6)


def test_the_level_counts_in_what_began_with_a_preparation(healthy: Scan) -> None:
    left = np.full(len(healthy.drive.x), 1e-7)
    left[:5] = 0.0
    known = with_added(healthy, left).whole(CHAIN)
    for experiment in (None, "broadband"):
        foreign = with_added(healthy, left, None, experiment).whole(CHAIN)
        assert abs(known.mean()) > 5.0 * abs(foreign.mean())


def test_drift_is_told_from_the_rest_on(healthy: Scan) -> None:
    """What the model errs by before the lines is no drift: the level of the lines says so."""
    true = drift(healthy, RATE, SETTLING)
    evidence = (with_added(healthy, true),)
    first = Problem(evidence, CHAIN, [FORM]).descend(np.array([[RATE, SETTLING]]))
    assert first is not None
    selected = FittedCandidates((Candidate(effect_type("drift"), FORM),), first, 0.0)
    found = refit_on_all(evidence, CHAIN, selected)
    errors = [
        abs(lines_of(SPEC, drift(healthy, *trial.fit.values) - true).mean())
        for trial in (found, selected)
    ]
    known = default_model().x.model_discrepancy
    assert known is not None
    assert errors[0] < known.rms[0]  # the slowest band's: no record tells a level better
    assert errors[0] < 0.7 * errors[1]
