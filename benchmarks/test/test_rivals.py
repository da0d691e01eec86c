"""A dominant term stands for the effect whose residual is like it, in any units."""

import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from afm_scan_bench.any_lab.effects import EFFECTS as DRAWN
from afm_scan_bench.any_lab.effects import course_of
from afm_scan_bench.any_lab.outcomes import DiagnosisStatement
from afm_scan_bench.any_lab.scanner import FAMILIES, draw
from afm_scan_bench.diagnosis.rivals import diagnosed, measure
from afm_scan_bench.diagnosis.term_selection import (
    EFFECTS,
    TERMS,
    effects_of,
    scaled,
    terms_of,
)
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import Array

SAMPLES = 2000


def triangles(amplitude: float) -> Array:
    phase = np.linspace(0.0, 5.0, SAMPLES, endpoint=False) % 1.0
    return amplitude * np.interp(phase, [0.0, 0.25, 0.75, 1.0], [0.0, 1.0, -1.0, 0.0])


@pytest.mark.parametrize("name", ["gain", "bend", "drift", "delay", "backlash"])
@pytest.mark.parametrize("seed", range(len(FAMILIES)))
def test_the_term_most_like_an_effect_stands_for_it(name: str, seed: int) -> None:
    scanner = draw(np.random.default_rng(seed), FAMILIES[seed])
    drive, course = triangles(2.0), course_of(scanner, 0.1 / scanner.resonance, SAMPLES, 0.5)
    moved = course.moved(drive)
    change = scaled(DRAWN[name].change(course, drive, 0.1) - moved)
    likeness = np.abs(change @ terms_of(moved)) / SAMPLES
    assert DRAWN[name].name in effects_of(int(likeness.argmax()))


@given(metres=st.floats(1e-9, 1e3))
def test_terms_have_no_units(metres: float) -> None:
    position = triangles(1.0) + 0.1 * triangles(1.0) ** 2 + 0.05 * np.roll(triangles(1.0), 7)
    terms = terms_of(metres * position)
    assert np.allclose(terms, terms_of(position), atol=1e-6)
    assert np.allclose(terms.mean(axis=0), 0.0)
    assert np.allclose(terms.std(axis=0), 1.0)


def test_every_term_is_nothing_an_effect_that_is_drawn_or_outside() -> None:
    known = {effect.name for effect in DRAWN.values()} | {"outside"}
    assert effects_of(None) == set()
    assert set(EFFECTS) < set(TERMS)
    assert all(effects_of(each) and effects_of(each) <= known for each in range(len(TERMS)))


@pytest.mark.parametrize(
    ("verdict", "stated", "expected"),
    [
        ("effect_found", "delay", (True, True)),
        ("effect_found", "drift", (True, False)),
        ("ambiguous", "drift", (True, True)),
        ("unexplained", "", (True, False)),
        ("model_sufficient", "", (False, False)),
    ],
)
def test_a_diagnosis_is_right_where_the_truth_is_stated_or_credible(
    verdict: str, stated: str, expected: tuple[bool, bool]
) -> None:
    probabilities = {"drift": 0.6, "delay": 0.39, "none": 0.01}
    statement = DiagnosisStatement(verdict, stated, probabilities, 1e-9, 1e-9, 1e-9, 0.0)
    assert diagnosed(statement, {"delay"}) == expected


def test_without_a_library_the_command_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pysindy", None)
    with pytest.raises(InputError, match=r"benchmarks\[rivals\]"):
        measure()
