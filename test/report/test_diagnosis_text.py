"""Shares and alternatives say what they are, where a reader would take them for something else."""

from types import SimpleNamespace
from typing import TYPE_CHECKING, cast

import pytest
from attrs import evolve

from afm_scan_ros.core.diagnosis.axis_diagnosis import AMBIGUOUS, FOUND, INSUFFICIENT, SUFFICIENT
from afm_scan_ros.core.diagnosis.result import (
    MODEL_ERROR,
    Alternative,
    EffectEvidence,
    IdentifiedEffect,
    WhyNot,
)
from afm_scan_ros.report.diagnosis_text import (
    alternative_rows,
    evidence_text,
    next_steps,
    share_text,
)

if TYPE_CHECKING:
    from afm_scan_ros.core.diagnosis.diagnosis import ScannerDiagnosis


EVIDENCE = EffectEvidence(
    2e-8, 1e-8, 90.0, 14.0, 14, (), None, None, synchronous=False, largest_ratio=1.1
)


@pytest.mark.parametrize(
    ("fraction", "percent", "more"), [(0.874, "87.4 %", False), (2.553, "255 %", True)]
)
def test_a_share_beyond_all_says_how_it_can_be(fraction: float, percent: str, more: bool) -> None:  # noqa: FBT001 - a parameter
    text = share_text(IdentifiedEffect("delay", "", (), "x", (), fraction, EVIDENCE))
    assert percent in text
    assert ("cancel" in text) is more


def test_what_does_as_well_is_no_runner_up() -> None:
    """One axis may be ambiguous where the other is not."""
    kept = ("delay",), "", 14.0
    found = SimpleNamespace(
        by_axis={"x": SimpleNamespace(verdict=AMBIGUOUS), "y": SimpleNamespace(verdict=FOUND)},
        alternatives=(
            Alternative(MODEL_ERROR, "", "x", 99.0, WhyNot.MODEL_ERROR, *kept),
            Alternative("drift", "", "y", 20.0, WhyNot.LARGER_MISFIT, *kept),
        ),
    )
    diagnosis = cast("ScannerDiagnosis", found)
    ((name, axis, score, _),) = alternative_rows(diagnosis, ambiguous=True)
    assert (name, axis, score) == ("model_error", "x", "99.0")
    ((name, axis, score, why),) = alternative_rows(diagnosis, ambiguous=False)
    assert (name, axis, score) == ("drift, exponential", "y", "20.0")
    assert "more than the 14.0 of delay" in why


def test_evidence_states_its_figures_and_doubts() -> None:
    doubtful = evolve(
        EVIDENCE,
        competing=(("input_lag", 15.0),),
        runner_up=("drift", 40.0),
        synchronous=True,
    )
    for evidence, parts in (
        (EVIDENCE, ("20.0 nm rms without", "10.0 nm rms with", "90.0", "1.1 times")),
        (doubtful, ("input_lag 15.0", "drift", "40.0", "repeats with the motion")),
    ):
        text = " ".join(evidence_text(IdentifiedEffect("delay", "", (), "x", (), 0.9, evidence)))
        assert all(part in text for part in parts), text


def test_the_next_step_depends_on_the_verdict() -> None:
    delay = IdentifiedEffect("delay", "", (), "x", (), 0.9, EVIDENCE)

    def steps(verdict: str, experiment: str | None, *effects: IdentifiedEffect) -> str:
        found = SimpleNamespace(
            verdict=verdict, untested=False, experiment=experiment, effects=effects
        )
        return " ".join(next_steps(cast("ScannerDiagnosis", found)))

    assert "scan with this model" in steps(SUFFICIENT, None)
    assert "model.extended.yaml" in steps(FOUND, None, delay)
    assert "--experiment dither" in steps(AMBIGUOUS, "dither", delay)
    assert "model.extended.yaml" not in steps(AMBIGUOUS, "dither", delay)
    assert "Every proposed experiment is recorded" in steps(INSUFFICIENT, None)
