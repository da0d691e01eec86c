"""What a drawn diagnosis is counted as, and that effects of no size change nothing."""

import numpy as np
import pytest

from afm_scan_bench.any_lab.effects import EVERY, course_of
from afm_scan_bench.any_lab.outcomes import DiagnosisOutcome, DiagnosisStatement
from afm_scan_bench.any_lab.scanner import FAMILIES, draw

SCANNER = draw(np.random.default_rng(4), FAMILIES[0])
PERIOD = 0.1 / SCANNER.resonance
DRIVE = 2.0 * np.sin(2.0 * np.pi * 3.0 * np.linspace(0.0, 1.0, 8000))


def outcome(effect: str, verdict: str, stated: str, **probabilities: float) -> DiagnosisOutcome:
    joined = {name.replace("_and_", " + "): p for name, p in probabilities.items()}
    statement = DiagnosisStatement(verdict, stated, joined, 1e-9, 1e-9, 1e-9, 1.0)
    return DiagnosisOutcome(
        0, "play", "curves and sweep", 500.0, 1e-5, 0, "", effect, 5.0, (statement,), statement
    )


@pytest.mark.parametrize(
    ("effect", "verdict", "stated", "probabilities", "expected"),
    [
        ("lag", "effect_found", "input_lag", {"input_lag": 1.0}, "named"),
        ("hum", "effect_found", "periodic_disturbance + periodic_disturbance", {}, "named"),
        ("lag", "effect_found", "delay", {"delay": 1.0}, "wrong"),
        ("lag", "effect_found", "delay + input_lag", {}, "wrong"),
        ("drift + lag", "effect_found", "drift", {"drift": 1.0}, "partly"),
        ("drift + lag", "effect_found", "drift + input_lag", {}, "named"),
        ("lag", "ambiguous", "delay", {"delay": 0.7, "input_lag": 0.3}, "credible"),
        ("lag", "ambiguous", "delay", {"delay": 0.96, "input_lag": 0.04}, "uncovered"),
        ("ripple", "ambiguous", "delay", {"delay": 0.7, "outside": 0.3}, "credible"),
        ("ripple", "unexplained", "", {"outside": 1.0}, "unexplained"),
        ("lag", "model_sufficient", "", {"none": 1.0}, "missed"),
    ],
)
def test_outcomes_are_counted_by_what_was_stated(
    effect: str, verdict: str, stated: str, probabilities: dict[str, float], expected: str
) -> None:
    assert outcome(effect, verdict, stated, **probabilities).result == expected


@pytest.mark.parametrize("name", EVERY)
def test_an_effect_grows_from_nothing(name: str) -> None:
    course = course_of(SCANNER, PERIOD, len(DRIVE), 0.4)
    healthy = course.moved(DRIVE)
    sizes = [1e-9, *(share * EVERY[name].largest for share in (0.1, 0.5))]
    added = [float(np.std(EVERY[name].change(course, DRIVE, size) - healthy)) for size in sizes]
    assert added[0] < 1e-2 * added[2]
    assert added[0] < added[1] < added[2]
