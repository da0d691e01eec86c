"""A lag of less than a sample is told from a delay by waves that are shaken."""

import numpy as np
import pytest
from attrs import evolve

from afm_scan_ros.core.diagnosis.fit import Problem, inserted
from afm_scan_ros.core.diagnosis.likelihood import Likelihood
from afm_scan_ros.core.diagnosis.preparation import evidence_of
from afm_scan_ros.core.diagnosis.settings import LIMIT
from afm_scan_ros.core.effects.registry import effect_type
from afm_scan_ros.core.identification.drives.experiments import dither_plan
from afm_scan_ros.core.record import Record
from afm_scan_ros.core.scanner import chain_of
from afm_scan_ros.simulation.mechanisms.base import Mechanism
from afm_scan_ros.simulation.mechanisms.electronics import DelayedConverter, LaggingAmplifier
from helpers.in_process import InProcessSession, default_model, default_plant

LATE = 17e-6  # s; a sample of the experiment takes 20 µs
SCANNERS = {
    "delay": DelayedConverter(axis="x", delay=LATE),
    "input_lag": LaggingAmplifier(axis="x", resistance=170.0, capacitance=100e-9),
}
ODDS = np.log(19.0)
"""Nats of a probability of 95 % between two."""
CHAIN = chain_of(default_model().x)


def dithered(*mechanisms: Mechanism) -> Record:
    session = InProcessSession(evolve(default_plant(), mechanisms=mechanisms))
    return session.experiment(dither_plan())


@pytest.mark.evidence
@pytest.mark.parametrize(("true", "other"), [("delay", "input_lag"), ("input_lag", "delay")])
def test_a_delay_and_a_lag_of_less_than_a_sample_are_told_apart(true: str, other: str) -> None:
    evidence = (evidence_of("x", default_model(), dithered(SCANNERS[true])),)
    likely = {}
    for name in (true, other):
        form = effect_type(name).form("")
        found = Problem(evidence, CHAIN, [form]).descend(np.array([[LATE]]))
        assert found is not None
        chain = inserted(CHAIN, [form], found.rows)
        likely[name] = Likelihood(evidence, CHAIN).fit(chain).log_likelihood
    assert likely[true] > likely[other] + 2.0 * ODDS


@pytest.mark.parametrize("axis", ["x", "y"])
def test_a_healthy_scanner_leaves_its_floor(axis: str) -> None:
    seen = evidence_of(axis, default_model(), dithered())
    assert seen.ratio(chain_of(default_model().axis(axis))).max() < LIMIT.expected
