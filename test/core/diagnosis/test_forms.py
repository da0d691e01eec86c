"""Forms of one effect are told apart from the rest on; where they are not, that is said."""

from collections.abc import Callable

import numpy as np
import pytest
from attrs import evolve

from afm_scan_ros.core.diagnosis import experiments, search
from afm_scan_ros.core.diagnosis.axis_diagnosis import AMBIGUOUS, FOUND
from afm_scan_ros.core.diagnosis.candidates import Candidate, CandidateFitter, FittedCandidates
from afm_scan_ros.core.diagnosis.competing import MARGIN, distinguish_forms
from afm_scan_ros.core.diagnosis.diagnosis import ScannerDiagnosis, diagnose
from afm_scan_ros.core.diagnosis.fit import Problem, inserted
from afm_scan_ros.core.diagnosis.preparation import evidence_of
from afm_scan_ros.core.diagnosis.records import Observation
from afm_scan_ros.core.diagnosis.result import WhyNot
from afm_scan_ros.core.effects.registry import effect_type
from afm_scan_ros.core.scan import Scan
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.scanner import chain_of
from afm_scan_ros.report.diagnosis_text import effects, evidence_text, limits_text
from helpers.in_process import ALL, default_model, scan

SPEC = ScanSpec(line_rate=20.0, lines=6, samples_per_line=500)
CHAIN = chain_of(default_model().x)
BEND = effect_type("static_nonlinearity")
BENT = {"": np.array([300.0, 3.4e6]), "drive": np.array([1.8e-3, 1.4e-4])}
"""By kind: these do all but the same to a scan, its level left out."""


@pytest.fixture(scope="module")
def healthy() -> Scan:
    return scan(SPEC, ALL)


def bent(healthy: Scan, kind: str) -> Observation:
    """A scan of a scanner that bends in one of two places."""
    drive, period = healthy.drive.x, SPEC.sample_period
    chains = CHAIN, BEND.form(kind).insert(CHAIN, BENT[kind])
    straight, curved = (c.forward(period) for c in chains)
    moved = curved.apply(curved.at_rest(), drive)[1] - straight.apply(straight.at_rest(), drive)[1]
    measured = evolve(healthy.measured, x=healthy.measured.x + moved)
    return Observation("scan", healthy.drive, measured, SPEC)


def fitted(bench: CandidateFitter, kind: str) -> FittedCandidates:
    candidate = Candidate(BEND, BEND.form(kind))
    found = Problem(bench.evidence, CHAIN, [candidate.form]).descend(BENT[kind][None])
    assert found is not None
    chain = inserted(CHAIN, [candidate.form], found.rows)
    return FittedCandidates((candidate,), found, bench.misfit(chain))


@pytest.mark.parametrize(("true", "other"), [("", "drive"), ("drive", "")])
def test_a_bend_is_laid_where_the_level_from_the_rest_on_says(
    healthy: Scan, true: str, other: str
) -> None:
    bench = CandidateFitter((evidence_of("x", default_model(), bent(healthy, true)),), CHAIN)
    right, wrong = (fitted(bench, kind) for kind in (true, other))
    assert abs(right.misfit - wrong.misfit) < MARGIN
    best, _ = distinguish_forms(bench, wrong, lambda *_: iter([right]))
    assert best is right


@pytest.fixture
def traced(healthy: Scan, monkeypatch: pytest.MonkeyPatch) -> Callable[[str], ScannerDiagnosis]:
    """ScannerDiagnosis of a scanner that bends; no other effect and few experiments are tried."""
    alone = tuple(c for c in search.CANDIDATES if c.effect is BEND)
    few = {name: experiments.EXPERIMENTS[name] for name in ("amplitudes", "chirp", "rest")}
    monkeypatch.setattr(search, "CANDIDATES", alone)
    monkeypatch.setattr(experiments, "EXPERIMENTS", few)
    return lambda kind: diagnose(default_model(), [bent(healthy, kind)])


def test_a_bend_is_named_where_its_other_forms_move_alike(
    traced: Callable[[str], ScannerDiagnosis],
) -> None:
    found = traced("")
    assert (found.verdict, found.effects[0].kind) == (FOUND, "")
    assert found.experiment is None


def test_a_form_that_is_not_told_apart_is_said_and_what_tells_it_proposed(
    traced: Callable[[str], ScannerDiagnosis],
) -> None:
    found = traced("drive")
    assert (found.verdict, found.effects[0].kind) == (AMBIGUOUS, "drive")
    others = [other for other in found.alternatives if other.why_not is WhyNot.SAME_EFFECT]
    assert "of the sensor" in {other.kind_label for other in others}
    assert {other.selected_kind for other in others} == {"drive"}
    assert any("As 'of the sensor'" in text for text in evidence_text(found.effects[0]))
    assert any("or 'of the sensor'" in sentence for sentence in limits_text(found))
    (table,) = effects(found)
    first, *_ = table.rows
    assert first[0] == "static_nonlinearity, of the drive"
    assert first[-1].endswith("*")
    assert any("the intervals hold if it is 'of the drive'" in said for said in limits_text(found))
    assert found.experiment == "chirp"
