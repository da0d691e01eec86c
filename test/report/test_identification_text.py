"""Every finding of an identification has a text, with its figures and what to do."""

import inspect

import pytest

from afm_scan_ros.core.identification import findings
from afm_scan_ros.core.identification.findings import (
    AmplitudeDependentResponse,
    CoarseLines,
    CreepBeyondNoise,
    CreepGainMismatch,
    DistortedSweep,
    Finding,
    GainMismatch,
    Hum,
    InexactDirectInverse,
    InexactInverse,
    LowCoherence,
    MisfitCause,
    NarrowBand,
    NegativeCreepGain,
    NotConverged,
    NotValidated,
    OpenLoops,
    ReadAfterUpdate,
    ResponseMisfit,
    SaturatedRecord,
    SensorLowPass,
    ShortHold,
    SingleWave,
    SlowStep,
    UncertainScan,
    UndeterminedCreepElement,
    UnfinishedRecord,
    UnknownStart,
    UnmodelledDelay,
    ValidationMismatch,
)
from afm_scan_ros.report.fit_summary import finding_text

INF = float("inf")
EXAMPLES: dict[Finding, tuple[str, ...]] = {
    NegativeCreepGain(2, 31.0): ("element 2", "31 s", "record again"),
    UndeterminedCreepElement(3, 0.1, (0.08, 0.12), 900.0, (700.0, 1100.0), 300.0): (
        "element 3",
        "±20%",
        "700 to 1100 s",
        "Hold it for 15 min",
    ),
    UndeterminedCreepElement(3, 0.1, (0.05, INF), 900.0, (700.0, INF), 300.0): (
        "gain above 0.05",
        "time constant above 700 s",
        "Hold it for 50 min",
    ),
    UndeterminedCreepElement(1, 0.1, (0.0, 0.3), 9.0, (0.0, INF), 300.0): (
        "gain below 0.3",
        "time constant unknown",
        "larger step",
    ),
    CreepBeyondNoise(3e-9, 2e-9): ("sigma 3 nm", "noise of 2 nm"),
    ShortHold(300.0, 100.0, 1800.0): ("300 s", "slower than 100 s", "30 min"),
    SlowStep(0.09, 0.021): ("0.09 s", "2.1%"),
    AmplitudeDependentResponse(0.03, 0.001): ("3.0%", "0.1%", "smaller amplitude"),
    DistortedSweep(0.006, 0.07): ("0.6%", "7%", "less amplitude"),
    LowCoherence(600.0, 0.95): ("0.95", "600 Hz"),
    NarrowBand((4.0, 458.0), 450.0, (225.0, 540.0)): ("4 to 458 Hz", "225 Hz", "540 Hz"),
    CoarseLines(10.0, 10.8): ("every 10.0 Hz", "5.4 Hz", "0.19 s"),
    UnmodelledDelay(2e-5, (1.8e-5, 2.2e-5)): ("lags", "20.0 µs", "18.0 to 22.0", "--delay"),
    UnmodelledDelay(-2e-5, (-2.2e-5, -1.8e-5)): ("leads", "20.0 µs", "18.0 to 22.0"),
    ResponseMisfit(0.03, (5.0, 700.0), MisfitCause.MODES, 0.03): ("3.00%", "more modes"),
    ResponseMisfit(0.03, (5.0, 700.0), MisfitCause.NOISE, 0.028): ("Noise is 2.80%", "larger"),
    ResponseMisfit(0.03, (5.0, 700.0), MisfitCause.NONLINEARITY, 0.02): ("2.00%", "smaller"),
    GainMismatch(1.2): ("1.200 times",),
    InexactInverse(0.002, 0.005): ("0.20%", "0.50%"),
    InexactDirectInverse(0.1, 0.2, 0.0416, 0.118): ("0.1000 V", "0.200 V", "0.0416 V"),
    OpenLoops(0.01): ("0.01 V",),
    UnfinishedRecord("creep", 0.0, 2.0): ("creep record ends at 2 V, not at 0 V",),
    CreepGainMismatch(0.85, 3.2): ("0.850 times", "3.2 V"),
    SingleWave(): ("one wave", "scatter from line to line", "33 lines", "several draws"),
    SaturatedRecord("frequency", "top", 0.03, 7.2): ("frequency", "top", "3.0%", "7.2 V"),
    ValidationMismatch("check.csv", 0.04): ("predicts check.csv", "4.0%", "one axis"),
    Hum("creep", ((50.06, 15e-9), (150.18, 4e-9))): (
        "creep",
        "15 nm at 50.06 Hz",
        "4 nm at 150.18",
    ),
    NotValidated(): ("error is not known", "validation record"),
    ReadAfterUpdate("steps"): ("displacement in steps", "after the drive's update", "next sample"),
    UncertainScan(0.034): ("3.4% of its range", "triangles or loops"),
    NotConverged(12.5): ("has not converged", "12.5 nat", "further records"),
    UnknownStart("scan", 0.25): ("start of scan is unknown", "0.25 s", "Depolarise"),
    SensorLowPass(2, 512.3): ("low-pass of order 2 at 512.3 Hz", "ahead of what the sensor shows"),
}


@pytest.mark.parametrize("finding", EXAMPLES, ids=lambda f: type(f).__name__)
def test_a_finding_states_its_figures(finding: Finding) -> None:
    text = finding_text(finding)
    assert all(part in text for part in EXAMPLES[finding]), text


def test_every_kind_of_finding_has_an_example() -> None:
    kinds = {c for _, c in inspect.getmembers(findings, inspect.isclass) if issubclass(c, Finding)}
    assert {type(finding) for finding in EXAMPLES} == kinds - {Finding}


@pytest.mark.parametrize("finding", EXAMPLES, ids=lambda f: type(f).__name__)
def test_sentences_are_short(finding: Finding) -> None:
    for sentence in finding_text(finding).split(". "):
        assert len(sentence.split()) <= 25, sentence
