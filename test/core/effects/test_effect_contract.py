"""The contract of effects/base.py, held by every effect in one table."""

import copy
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import paper
import pytest
from attrs import frozen
from hypothesis import given, settings
from hypothesis import strategies as st

from afm_scan_ros.core.effects.base import Cascade, Gain
from afm_scan_ros.core.effects.creep import Creep
from afm_scan_ros.core.effects.hysteresis.duhem import Duhem
from afm_scan_ros.core.effects.hysteresis.preisach import DirectInverse, Preisach
from afm_scan_ros.core.effects.vibration import Vibration
from afm_scan_ros.core.model import InverseSettings
from afm_scan_ros.core.scanner import chain_of, forward

PERIOD = 5e-5
AXIS = paper.axis()
STATIC = AXIS.vibration.static_gain


@frozen
class Case:
    """An effect with the size of its inputs and outputs, and the band of its inverse."""

    effect: Any
    input: float
    output: float
    band: float  # of the output


def _case_of_compensator(*inverses: str) -> Case:
    chain = chain_of(AXIS).compensator(PERIOD, inverses, InverseSettings())
    return Case(chain, 4.0, 5.0 * STATIC, 1e-3)


CASES = {
    "creep": Case(Creep(AXIS.creep, PERIOD), 1e-5, 1e-5, 1e-12),
    "vibration": Case(Vibration(AXIS.vibration, PERIOD), 5.0, 1e-5, 1e-3),
    "preisach": Case(Preisach(AXIS.hysteresis.forward), 4.0, 5.5, 1e-12),
    "direct": Case(DirectInverse(AXIS.hysteresis.direct), 4.0, 5.5, 1e-12),
    "duhem": Case(Duhem(paper.coleman_hodgdon()), 4.0, 3.0, 1e-12),
    "gain": Case(Gain(2.5), 1.0, 1.0, 1e-12),
    "no effect": Case(Cascade(()), 1.0, 1.0, 0.0),
    "all inverses": _case_of_compensator("creep", "hysteresis", "vibration"),
    "no inverse": _case_of_compensator(),
    "model": Case(forward(AXIS, PERIOD), 4.0, 5.0 * STATIC, 1e-3),
}
every_effect = pytest.mark.parametrize("case", CASES.values(), ids=CASES.keys())
seeds = st.integers(0, 2**32 - 1)
cuts = st.lists(st.integers(0, 400), max_size=6)


def in_blocks(
    step: Callable[[Any, np.ndarray], Any],
    state: object,
    signal: np.ndarray,
    cut: Sequence[int],
) -> tuple[Any, np.ndarray]:
    """Result of a step that is given the signal in blocks, some of them empty."""
    parts = []
    for block in np.split(signal, sorted(cut)):
        state, part = step(state, block)
        parts.append(part)
    return state, np.concatenate(parts)


def same(a: np.ndarray, b: np.ndarray, scale: float) -> None:
    """Fail unless equal up to the rounding of sums in another order."""
    assert a.shape == b.shape
    assert np.abs(a - b).max(initial=0.0) <= 1e-12 * scale


@every_effect
@settings(deadline=None, max_examples=20)
@given(seed=seeds, cut=cuts)
def test_applying_in_blocks_changes_nothing(case: Case, seed: int, cut: list[int]) -> None:
    inputs = np.random.default_rng(seed).uniform(-case.input, case.input, 400)
    start = case.effect.at_rest()
    _, whole = case.effect.apply(start, inputs)
    _, parts = in_blocks(case.effect.apply, start, inputs, cut)
    same(parts, whole, np.abs(whole).max())


@every_effect
@settings(deadline=None, max_examples=20)
@given(seed=seeds, cut=cuts)
def test_inverting_in_blocks_changes_nothing(case: Case, seed: int, cut: list[int]) -> None:
    targets = paper.smooth_target(seed, 400, 0.8 * case.output)
    start = case.effect.inverse_at_rest()
    end, whole = case.effect.invert(start, targets)
    end_parts, parts = in_blocks(case.effect.invert, start, targets, cut)
    scale = 10.0 * case.input
    same(parts, whole, scale)
    same(case.effect.finish(end_parts), case.effect.finish(end), scale)


@every_effect
@settings(deadline=None, max_examples=10)
@given(seed=seeds, samples=st.integers(1, 900))
def test_the_inverse_gives_as_many_samples_as_it_was_given(
    case: Case, seed: int, samples: int
) -> None:
    targets = paper.smooth_target(seed, samples, 0.5 * case.output)
    state, first = case.effect.invert(case.effect.inverse_at_rest(), targets)
    assert len(first) + len(case.effect.finish(state)) == samples


@every_effect
@settings(deadline=None, max_examples=20)
@given(seed=seeds)
def test_applying_the_inverse_gives_the_target_back(case: Case, seed: int) -> None:
    targets = paper.smooth_target(seed, 2000, case.output)
    state, first = case.effect.invert(case.effect.inverse_at_rest(), targets)
    inputs = np.concatenate((first, case.effect.finish(state)))
    _, outputs = case.effect.apply(case.effect.at_rest(), inputs)
    assert np.abs(outputs - targets).max() <= case.band * case.output


@every_effect
def test_a_state_passed_in_is_not_changed(case: Case) -> None:
    signal = paper.smooth_target(7, 300, case.output)
    for step, state in (
        (case.effect.invert, case.effect.invert(case.effect.inverse_at_rest(), signal)[0]),
        (case.effect.apply, case.effect.apply(case.effect.at_rest(), signal / 10.0)[0]),
    ):
        kept = copy.deepcopy(state)
        first = step(state, signal[::-1] / 10.0)[1]
        assert repr(state) == repr(kept)
        assert np.array_equal(step(state, signal[::-1] / 10.0)[1], first)
