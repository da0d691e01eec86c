"""Each of several effects on one axis has its own share and evidence."""

import numpy as np
import pytest
from attrs import evolve

from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.diagnosis.axis_diagnosis import (
    AMBIGUOUS,
    FOUND,
    SUFFICIENT,
    AxisDiagnosis,
)
from afm_scan_ros.core.diagnosis.candidates import Candidate, FittedCandidates
from afm_scan_ros.core.diagnosis.fit import Fit, inserted
from afm_scan_ros.core.diagnosis.likelihood import CellFit, Likelihood
from afm_scan_ros.core.diagnosis.preparation import evidence_of
from afm_scan_ros.core.diagnosis.result import WhyNot, alternatives, effects
from afm_scan_ros.core.diagnosis.search import Posterior, Selection
from afm_scan_ros.core.diagnosis.settings import SEARCH
from afm_scan_ros.core.effects.registry import effect_type
from afm_scan_ros.core.record import Record
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.scanner import chain_of
from afm_scan_ros.core.types import Array
from afm_scan_ros.report.diagnosis_text import evidence_text, why_not_text
from helpers.in_process import ALL, default_model, scan
from helpers.posteriors import no_effect

SPEC = ScanSpec(line_rate=20.0, lines=6, samples_per_line=500)
CHAIN = chain_of(default_model().x)
VALUES = {"delay": (2e-4,), "drift": (1.5e-6, 10.0), "input_lag": (2e-4,)}


def candidate(name: str) -> Candidate:
    return Candidate(effect_type(name), effect_type(name).forms[0])


def trial(names: tuple[str, ...], cells: CellFit) -> FittedCandidates:
    rows = np.array([[value for name in names for value in VALUES[name]]])
    return FittedCandidates(tuple(map(candidate, names)), Fit(rows, 0.01 * np.abs(rows[0])), cells)


@pytest.fixture(scope="module")
def healthy() -> Record:
    done = scan(SPEC, ALL)
    return Record.of_traces("scan", done.drive, done.measured, SPEC)


def answer(chain: Chain, healthy: Record) -> Array:
    cascade = chain.forward(SPEC.sample_period)
    return cascade.apply(cascade.at_rest(), healthy.signals("x")[0])[1]


def traced(healthy: Record, *names: str, others: tuple[str, ...] = ()) -> AxisDiagnosis:
    """A scan of x with effects that are known, as if they had been found so."""
    none = CellFit(*4 * (np.zeros(0),), 0.0)
    chain = inserted(CHAIN, [candidate(n).form for n in names], trial(names, none).fit.rows)
    moved = answer(chain, healthy) - answer(CHAIN, healthy)
    wrong = healthy.displacement + np.outer(moved, [1.0, 0.0])
    evidence = (evidence_of("x", default_model(), evolve(healthy, displacement=wrong)),)
    likelihood = Likelihood(evidence, CHAIN)
    reached, without = likelihood.fit(chain), no_effect(likelihood.fit(CHAIN))
    trials = (trial(names, reached), *(trial((name,), reached) for name in others))
    return AxisDiagnosis(
        axis="x",
        evidence=evidence,
        chain=CHAIN,
        extended=chain,
        held_out=chain,
        selection=Selection(without, trials, Posterior.of(without, trials)),
        time_varying=(),
    )


def mean_square(trace: AxisDiagnosis, residual: Array) -> float:
    return float(np.mean(residual[~trace.evidence[0].fitted] ** 2))


def test_the_share_is_what_comes_back_without_the_effect_alone(healthy: Record) -> None:
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


def test_of_one_effect_the_share_is_all_that_is_explained(healthy: Record) -> None:
    trace = traced(healthy, "delay")
    (effect,) = effects(trace)
    fallen = 1.0 - (trace.rms(trace.extended) / trace.rms(trace.chain)) ** 2
    assert effect.explained_fraction == pytest.approx(fallen, rel=1e-9)


def test_the_evidence_is_each_effect_s_own(healthy: Record) -> None:
    drift, delay = effects(traced(healthy, "drift", "delay"))
    (alone,) = effects(traced(healthy, "delay"))
    assert drift.evidence.rms_without > 2.0 * delay.evidence.rms_without
    # With the drift in, the residual without the delay is that of the delay alone.
    for one in (delay, alone):
        assert one.evidence.rms_without > one.evidence.rms_with
        assert one.probability > SEARCH.certain
    assert alone.evidence.nats > 10.0
    assert delay.evidence.rms_without == pytest.approx(alone.evidence.rms_without, rel=1e-3)


def test_what_else_was_tried_has_its_probability(healthy: Record) -> None:
    trace = traced(healthy, "delay", others=("input_lag",))
    lag, none = alternatives(trace)
    assert (lag.name, lag.why_not, lag.selected) == ("input_lag", WhyNot.CREDIBLE, ("delay",))
    assert lag.probability == pytest.approx(0.5)
    assert lag.score == pytest.approx(0.0)
    assert (none.name, none.why_not) == ("none", WhyNot.INADEQUATE)
    assert trace.verdict == AMBIGUOUS
    assert "credible set of delay" in why_not_text(lag)


def test_one_effect_that_explains_all_is_found(healthy: Record) -> None:
    assert traced(healthy, "delay").verdict == FOUND


def test_a_value_at_the_edge_of_its_range_is_no_measurement(healthy: Record) -> None:
    trace = traced(healthy, "delay")
    (delay,) = candidate("delay").form.parameters
    rows = np.array([[delay.upper]])
    for values, said in ((np.array([[2e-4]]), False), (rows, True)):
        found = evolve(trace.selection.trials[0], fit=Fit(values, np.array([1e-6]), 0.0))
        posterior = Posterior.of(trace.selection.without, [found])
        (effect,) = effects(evolve(trace, selection=evolve(trace.selection, posterior=posterior)))
        assert any("Its delay is at the edge" in each for each in evidence_text(effect)) is said


def test_no_sentence_has_a_power_of_ten(healthy: Record) -> None:
    said = " ".join(s for e in effects(traced(healthy, "drift", "delay")) for s in evidence_text(e))
    assert "e+" not in said


@pytest.mark.parametrize(("none", "verdict"), [(0.1, SUFFICIENT), (-1.5, AMBIGUOUS), (-6.0, FOUND)])
def test_the_model_is_sufficient_where_it_is_the_most_probable(
    healthy: Record, none: float, verdict: str
) -> None:
    """An effect nearly as probable is not named; one far more probable is."""
    trace = traced(healthy, "drift")
    reached = trace.selection.trials[0]
    without = no_effect(evolve(reached.cells, log_likelihood=reached.log_posterior + none))
    posterior = Posterior.of(without, [reached])
    selection = Selection(without, (reached,), posterior)
    assert evolve(trace, selection=selection).verdict == verdict
