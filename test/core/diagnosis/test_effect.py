"""Each of several effects on one axis has its own share and evidence."""

import numpy as np
import pytest
from attrs import evolve

from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.diagnosis.axis_diagnosis import AxisDiagnosis
from afm_scan_ros.core.diagnosis.candidates import Candidate, FittedCandidates
from afm_scan_ros.core.diagnosis.competing import CompetingModel
from afm_scan_ros.core.diagnosis.evidence import misfit
from afm_scan_ros.core.diagnosis.fit import Fit, inserted
from afm_scan_ros.core.diagnosis.preparation import evidence_of
from afm_scan_ros.core.diagnosis.records import Observation
from afm_scan_ros.core.diagnosis.result import WhyNot, alternatives, effects
from afm_scan_ros.core.diagnosis.search import Selection
from afm_scan_ros.core.effects.registry import effect_type
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.scanner import chain_of
from afm_scan_ros.core.types import Array
from afm_scan_ros.report.diagnosis_text import evidence_text, why_not_text
from helpers.in_process import ALL, default_model, scan

SPEC = ScanSpec(line_rate=20.0, lines=6, samples_per_line=500)
CHAIN = chain_of(default_model().x)
VALUES = {"delay": (2e-4,), "drift": (1.5e-6, 10.0), "input_lag": (2e-4,)}


def candidate(name: str) -> Candidate:
    return Candidate(effect_type(name), effect_type(name).forms[0])


def trial(names: tuple[str, ...], left: float) -> FittedCandidates:
    rows = np.array([[value for name in names for value in VALUES[name]]])
    return FittedCandidates(
        tuple(map(candidate, names)), Fit(rows, 0.01 * np.abs(rows[0]), left), left
    )


@pytest.fixture(scope="module")
def healthy() -> Observation:
    done = scan(SPEC, ALL)
    return Observation("scan", done.drive, done.measured, SPEC)


def answer(chain: Chain, healthy: Observation) -> Array:
    cascade = chain.forward(SPEC.sample_period)
    return cascade.apply(cascade.at_rest(), healthy.drive.x)[1]


def traced(healthy: Observation, *names: str) -> AxisDiagnosis:
    """A scan of x with effects that are known, as if they had been found so."""
    chain = inserted(CHAIN, [candidate(n).form for n in names], trial(names, 0.0).fit.rows)
    moved = answer(chain, healthy) - answer(CHAIN, healthy)
    wrong = evolve(healthy.displacement, x=healthy.displacement.x + moved)
    evidence = evidence_of("x", default_model(), evolve(healthy, displacement=wrong))
    selected = trial(names, misfit([evidence], chain, fitted=False))
    first = tuple(trial((name,), 100.0) for name in VALUES)
    return AxisDiagnosis(
        axis="x",
        evidence=(evidence,),
        chain=CHAIN,
        extended=chain,
        selection=Selection(misfit([evidence], CHAIN, fitted=False), selected, (), (), first),
        refit_on_all=selected,
        time_varying=(),
        ratio_before=(evidence.ratio(CHAIN),),
        ratio_after=(evidence.ratio(chain),),
    )


def mean_square(trace: AxisDiagnosis, residual: Array) -> float:
    return float(np.mean(residual[~trace.evidence[0].fitted] ** 2))


def test_the_share_is_what_comes_back_without_the_effect_alone(healthy: Observation) -> None:
    trace = traced(healthy, "drift", "delay")
    (evidence,) = trace.evidence
    before, after = (evidence.residual(c) for c in (trace.chain, trace.extended))
    found = {effect.name: effect.explained_fraction for effect in effects(trace)}
    for name, other in (("drift", "delay"), ("delay", "drift")):
        rest = evidence.residual(
            inserted(CHAIN, [candidate(other).form], np.array([VALUES[other]]))
        )
        more = mean_square(trace, rest) - mean_square(trace, after)
        assert found[name] == pytest.approx(more / mean_square(trace, before), rel=1e-6)
    assert found["delay"] < 0.2
    assert found["drift"] > 0.8


def test_of_one_effect_the_share_is_all_that_is_explained(healthy: Observation) -> None:
    trace = traced(healthy, "delay")
    (effect,) = effects(trace)
    fallen = 1.0 - (trace.rms(trace.extended) / trace.rms(trace.chain)) ** 2
    assert effect.explained_fraction == pytest.approx(fallen, rel=1e-9)


def test_the_evidence_is_each_effect_s_own(healthy: Observation) -> None:
    drift, delay = effects(traced(healthy, "drift", "delay"))
    (alone,) = effects(traced(healthy, "delay"))
    assert drift.evidence.rms_without > 2.0 * delay.evidence.rms_without
    # With the drift in, the residual without the delay is that of the delay alone.
    for one in (delay, alone):
        assert one.evidence.rms_without > one.evidence.rms_with
        assert one.evidence.misfit_without > one.evidence.misfit_with
    assert delay.evidence.rms_without == pytest.approx(alone.evidence.rms_without, rel=1e-3)


def test_what_else_was_tried_says_where_it_was(healthy: Observation) -> None:
    """Trials alone say nothing of what stands in a place beside other effects."""
    trace = traced(healthy, "drift", "delay")
    assert not any(effect.evidence.runner_up for effect in effects(trace))
    (other,) = alternatives(trace)
    assert (other.why_not, other.selected) == (WhyNot.LARGER_MISFIT, ("drift", "delay"))
    assert why_not_text(other).startswith("alone, leaves more than the")
    (delay,) = effects(traced(healthy, "delay"))
    assert delay.evidence.runner_up == ("drift", 100.0)


def test_a_competing_effect_is_named_in_its_place(healthy: Observation) -> None:
    trace = traced(healthy, "drift", "delay")
    competing = CompetingModel(1, candidate("input_lag"), trial(("drift", "input_lag"), 9.0))
    trace = evolve(trace, selection=evolve(trace.selection, competing_models=(competing,)))
    drift, delay = effects(trace)
    (other,) = alternatives(trace)
    assert (other.name, other.why_not, other.selected) == (
        "input_lag",
        WhyNot.SAME_PLACE,
        ("delay",),
    )
    assert delay.evidence.competing == (("input_lag", 9.0),)
    assert drift.evidence.competing == ()


def test_a_misfit_says_how_many_bands_it_sums(healthy: Observation) -> None:
    """8.40 is less than the floor's 14, and reads as 8.4 times the floor without that."""
    trace = traced(healthy, "delay")
    (effect,) = effects(trace)
    bands = len(trace.evidence[0].limit.rms)
    assert effect.evidence.bands == bands
    assert any(f"{bands} at the detection limit" in text for text in evidence_text(effect))


def test_a_value_at_the_edge_of_its_range_is_no_measurement(healthy: Observation) -> None:
    trace = traced(healthy, "delay")
    (delay,) = candidate("delay").form.parameters
    rows = np.array([[delay.upper]])
    edge = evolve(trace.selection.selected, fit=Fit(rows, np.array([1e-4]), 0.0))
    for refit_on_all, said in ((trace.refit_on_all, False), (edge, True)):
        (effect,) = effects(evolve(trace, refit_on_all=refit_on_all))
        assert any("Its delay is at the edge" in each for each in evidence_text(effect)) is said


def test_no_sentence_has_a_power_of_ten(healthy: Observation) -> None:
    said = " ".join(s for e in effects(traced(healthy, "drift", "delay")) for s in evidence_text(e))
    assert "e+" not in said
