"""Every finding of an identification has a text, with its figures and what to do."""

import inspect

import pytest

from afm_scan_ros.core.identification import findings
from afm_scan_ros.core.identification.findings import (
    Finding,
    Hum,
    LateReading,
    NotConverged,
    NotValidated,
    ReadAfterUpdate,
    SensorLowPass,
    UncertainScan,
    UnknownStart,
    ValidationMismatch,
)
from afm_scan_ros.report.fit_page import finding_text

EXAMPLES: dict[Finding, tuple[str, ...]] = {
    ValidationMismatch("check.csv", 0.04): ("predicts check.csv", "4.0%", "one axis"),
    Hum("creep", ((50.06, 15e-9), (150.18, 4e-9))): (
        "creep",
        "15 nm at 50.06 Hz",
        "4 nm at 150.18",
    ),
    NotValidated(): ("error is not known", "validation record"),
    ReadAfterUpdate("steps", predicted=False): ("displacement in steps", "next sample"),
    ReadAfterUpdate("loops", predicted=True): ("displacement in loops", "what is read so"),
    UncertainScan(0.034): ("3.4% of its range", "triangles or loops"),
    NotConverged(12.5): ("has not converged", "12.5 nat", "further records"),
    UnknownStart("scan", 0.25): ("start of scan is unknown", "0.25 s", "Depolarise"),
    LateReading(0.00125): ("1.25 ms late", "leaves the delay alone"),
    SensorLowPass(2, 512.3): ("low-pass of order 2 at 512.3 Hz", "ahead of what the sensor shows"),
}


@pytest.mark.parametrize("finding", EXAMPLES, ids=lambda f: type(f).__name__)
def test_a_finding_states_its_figures(finding: Finding) -> None:
    text = finding_text(finding)
    assert all(part in text for part in EXAMPLES[finding]), text


def test_every_kind_of_finding_has_an_example() -> None:
    kinds = {c for _, c in inspect.getmembers(findings, inspect.isclass) if issubclass(c, Finding)}
    assert {type(finding) for finding in EXAMPLES} == kinds - {Finding}
