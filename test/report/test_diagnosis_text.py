"""Shares and alternatives are explained, where a reader would take them for something else."""

import math
from types import SimpleNamespace
from typing import TYPE_CHECKING, cast

import numpy as np
import pytest
from attrs import evolve

from afm_scan_ros.core.diagnosis.axis_diagnosis import (
    AMBIGUOUS,
    FOUND,
    INSUFFICIENT,
    SUFFICIENT,
    UNEXPLAINED,
)
from afm_scan_ros.core.diagnosis.experiments import Proposal, SizedExperiment
from afm_scan_ros.core.diagnosis.result import (
    MODEL_ERROR,
    Alternative,
    EffectEvidence,
    IdentifiedEffect,
    Value,
    WhyNot,
)
from afm_scan_ros.core.effects.registry import effect_type
from afm_scan_ros.report.diagnosis_text import (
    alternative_rows,
    evidence_text,
    next_steps,
    proposal,
    share_text,
    verdict_text,
)

if TYPE_CHECKING:
    from afm_scan_ros.core.diagnosis.diagnosis import ScannerDiagnosis


EVIDENCE = EffectEvidence(2e-8, 1e-8, 90.0, synchronous=False, largest_ratio=1.1)


@pytest.mark.parametrize(
    ("fraction", "percent", "more"), [(0.874, "87.4 %", False), (2.553, "255 %", True)]
)
def test_a_share_beyond_all_says_how_it_can_be(fraction: float, percent: str, more: bool) -> None:  # noqa: FBT001 - a parameter
    text = share_text(IdentifiedEffect("delay", "", (), "x", (), 0.99, fraction, EVIDENCE))
    assert percent in text
    assert ("cancel" in text) is more


def test_an_alternative_has_its_probability_and_why_it_is_not_added() -> None:
    found = SimpleNamespace(
        alternatives=(
            Alternative(MODEL_ERROR, "", "x", 0.0, math.nan, WhyNot.MODEL_ERROR, ("delay",)),
            Alternative("drift", "", "y", -5.0, 0.0066, WhyNot.LESS_PROBABLE, ("delay",)),
            Alternative("none", "", "y", -90.0, 1e-40, WhyNot.INADEQUATE, ("delay",)),
        ),
    )
    model, drift, none = alternative_rows(cast("ScannerDiagnosis", found))
    assert model[:3] == ("model_error", "x", "-")
    assert "repeats with the motion" in model[3]
    assert drift == ("drift, exponential", "y", "0.007", "less probable than delay")
    assert none[2] == "< 0.001"


def test_evidence_states_its_figures_and_doubts() -> None:
    doubtful = evolve(EVIDENCE, synchronous=True)
    for evidence, parts in (
        (EVIDENCE, ("20.0 nm rms without", "10.0 nm rms with", "90.0 nats", "1.1 times")),
        (doubtful, ("0.990", "repeats with the motion")),
    ):
        effect = IdentifiedEffect("delay", "", (), "x", (), 0.99, 0.9, evidence)
        text = " ".join(evidence_text(effect))
        assert all(part in text for part in parts), text


def test_the_next_step_depends_on_the_verdict() -> None:
    delay = IdentifiedEffect("delay", "", (), "x", (), 0.99, 0.9, EVIDENCE)

    def steps(verdict: str, experiment: str, *effects: IdentifiedEffect) -> str:
        wanted = Proposal("x", SizedExperiment(experiment, 2.7, 4.0), 1.6e-5, 0.98, 0.99)
        proposed = wanted if experiment else None
        found = SimpleNamespace(
            verdict=verdict, untested=False, proposal=proposed, effects=effects, by_axis={}
        )
        return " ".join(next_steps(cast("ScannerDiagnosis", found)))

    assert "scan with this model" in steps(SUFFICIENT, "")
    assert "model.extended.yaml" in steps(FOUND, "", delay)
    (parameter,) = effect_type("delay").forms[0].parameters
    edge = evolve(delay, values=(Value(parameter, parameter.upper, 1e-6),))
    assert "Do not scan with model.extended.yaml" in steps(FOUND, "", edge)
    doubt = steps(AMBIGUOUS, "dither", delay)
    assert "--experiment dither --amplitude 2.7V --duration 4s" in doubt
    assert "an amplitude of 2.70 V (16.0 µm in x), 4.00 s long" in doubt
    assert "at least 0.98 bits on the effects in x" in doubt
    assert "model.extended.yaml" not in steps(AMBIGUOUS, "dither", delay)
    assert "Every proposed experiment is recorded" in steps(INSUFFICIENT, "")


def test_the_size_of_an_experiment_has_three_digits_and_exceeds_no_limit() -> None:
    text = proposal(Proposal("x", SizedExperiment("dither", 1.99999, 2.200357)))
    assert "--amplitude 1.99V --duration 2.2s" in text


def test_an_unexplained_residual_is_said_to_exceed_its_limit_in_a_band() -> None:
    limit = SimpleNamespace(edges=(0.0, 10.0, 40.0, 160.0))
    of_axis = SimpleNamespace(
        axis="x",
        verdict=UNEXPLAINED,
        ratio_before=(np.array([0.5, 3.2, 1.1]),),
        evidence=(SimpleNamespace(limit=limit),),
        rms_before=1e-9,
        limit=2e-9,
    )
    found = SimpleNamespace(verdict=UNEXPLAINED, by_axis={"x": of_axis})
    verdict, where = verdict_text(cast("ScannerDiagnosis", found))
    assert "at some frequencies" in verdict
    assert where.startswith("x: the residual is 3.2 times its detection limit from 10 to 40 Hz.")
    assert where.endswith("is below the limit.")
    of_axis.rms_before = 3e-9
    _, where = verdict_text(cast("ScannerDiagnosis", found))
    assert "below" not in where
