"""Mechanisms of friction.py, each against the solution of its equation."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import integrate

from afm_scan_bench.mechanisms.friction import (
    RETURN_STRESS,
    STRIBECK_SPEED,
    PressedBalls,
    RubbingGuide,
    StribeckGuide,
    SuperelasticLeaf,
)
from afm_scan_ros.core.types import Array
from helpers.acting import STAGE, STEP, STIFF_STAGE, TIME, held


def test_bristles_are_a_spring_until_they_slip() -> None:
    stiff = RubbingGuide(axis="x", share=0.1, reaches=(1.0,)).attached(STAGE)
    slipping = RubbingGuide(axis="x", share=0.1, reaches=(1e-7,)).attached(STAGE)
    ramp = np.concatenate((np.linspace(0.0, 10e-6, 200_000), np.full(200_000, 10e-6)))
    pushed = np.vstack((ramp, np.zeros(ramp.size)))
    _, held = stiff.apply(stiff.at_rest(STEP, np.random.default_rng(0)), pushed, STEP)
    _, moved = slipping.apply(slipping.at_rest(STEP, np.random.default_rng(0)), pushed, STEP)
    assert held[0, -1] == pytest.approx(10e-6 / 1.1, rel=1e-6)
    assert moved[0, 199_000] == pytest.approx(ramp[199_000] - 0.1 * 1e-7, abs=1e-9)


def bent(guide: StribeckGuide, path: Array) -> tuple[Array, Array]:
    """How far a guide's bristles are bent in the end, and u (m), along a path (m)."""
    attached = guide.attached(STAGE)
    pushed = np.vstack((path, np.zeros(path.size)))
    rest = attached.at_rest(STEP, np.random.default_rng(0))
    (state, _), signals = attached.apply(rest, pushed, STEP)
    return state[2:], signals[0] - path


@pytest.mark.parametrize("speed", [1e-5, 1e-3, 2e-3, 1e-2])
def test_a_greased_guide_holds_by_stribecks_curve(speed: float) -> None:
    guide = StribeckGuide(axis="x", share=0.01, reaches=(1e-7,), stiction=1.0)
    (bend,), u = bent(guide, speed * STEP * np.arange(400_000 if speed == 1e-5 else 40_000))
    held = 1e-7 * (1.0 + np.exp(-((speed / STRIBECK_SPEED) ** 2)))
    assert bend == pytest.approx(held, rel=1e-2)
    assert u[-1] == pytest.approx(-0.01 * held, rel=2e-2)


@settings(deadline=None, max_examples=20)
@given(seed=st.integers(0, 10_000), stiction=st.floats(0.0, 3.0))
def test_a_greased_guide_gives_back_no_more_than_it_took(seed: int, stiction: float) -> None:
    rng = np.random.default_rng(seed)
    path = np.cumsum(rng.normal(0.0, 1e-8, 3000)) + 1e-5 * np.sin(rng.uniform(1, 30) * TIME[:3000])
    guide = StribeckGuide(axis="x", share=0.01, reaches=(3e-7,), stiction=stiction).attached(STAGE)
    state, taken, before, last = guide.at_rest(STEP, rng), 0.0, 0.0, 0.0
    for k in range(path.size):
        state, moved = guide.apply(state, np.array([[path[k]], [0.0]]), STEP)
        bend, x = float(state[0][2]), float(moved[0, 0])
        taken += 0.5 * (bend + before) * (x - last)
        assert taken >= 0.5 * bend**2 * (1.0 - 1e-2) - 1e-18
        before, last = bend, x


def rubbed(push: Array) -> Array:
    """What balls of a reach of 10 um hold, in units of that and of their share."""
    balls = PressedBalls(axis="x", share=1e-3, reach=10e-6).attached(STIFF_STAGE)
    both = np.vstack((10e-6 * push, np.zeros(push.size)))
    moved = balls.apply(balls.at_rest(STEP, np.random.default_rng(0)), both, STEP)[1][0]
    return (10e-6 * push - moved) / 10e-9


def mindlin(x: Array) -> Array:
    return 2.0 / 3.0 * (1.0 - np.maximum(1.0 - x, 0.0) ** 1.5)


def test_balls_hold_as_mindlins_contact_does_forth_and_back() -> None:
    there = np.linspace(0.0, 0.8, 20_001)
    held = rubbed(np.concatenate((there, there[::-1])))
    np.testing.assert_allclose(held[:20_001], mindlin(there), atol=2e-3)
    back = mindlin(np.array(0.8)) - 2.0 * mindlin(0.5 * there)
    np.testing.assert_allclose(held[20_001:], back, atol=2e-3)
    assert rubbed(np.linspace(0.0, 2.0, 20_001))[-1] == pytest.approx(2.0 / 3.0, rel=2e-3)


@pytest.mark.parametrize("amplitude", [0.2, 0.4, 0.8])
def test_balls_lose_in_a_loop_what_masings_rule_says(amplitude: float) -> None:
    """Eight times what their law takes on the way there beyond what a spring would."""
    push = amplitude * np.sin(4.0 * np.pi * np.arange(160_001) / 160_000)
    lost = integrate.trapezoid(rubbed(push)[80_000:], push[80_000:])
    there = np.linspace(0.0, amplitude, 10_001)
    taken = integrate.trapezoid(mindlin(there), there)
    expected = 8.0 * (taken - 0.5 * amplitude * mindlin(there)[-1])
    assert lost == pytest.approx(expected, rel=4e-2)


def test_a_leaf_turns_and_turns_back_on_a_flag() -> None:
    reach, share = 4e-6, 1e-3
    out = np.linspace(0.0, 10e-6, 1000)
    path = np.concatenate((out, out[::-1], -out, -out[::-1]))
    leaf = SuperelasticLeaf(axis="x", share=share, reaches=(reach,))
    bent = (path - held(leaf, path, np.zeros_like(path), STIFF_STAGE)) / share
    on_the_way_out = np.minimum(out, reach)
    back = np.maximum(np.minimum(out, RETURN_STRESS * reach), out - (10e-6 - reach))
    flag = np.concatenate((on_the_way_out, back[::-1]))
    np.testing.assert_allclose(bent, np.concatenate((flag, -flag)), atol=0.03 * reach)


@settings(deadline=None, max_examples=20)
@given(seed=st.integers(0, 10_000), size=st.floats(0.1e-6, 10e-6))
def test_leaves_lose_nothing_where_the_motion_is_small_and_never_give(
    seed: int, size: float
) -> None:
    corners = np.random.default_rng(seed).uniform(-1.0, 1.0, 20)
    path = size * np.interp(np.linspace(0, 21, 42_000), np.arange(22), np.r_[0.0, corners, 0.0])
    leaf = SuperelasticLeaf(axis="x", share=1e-4, reaches=(2e-6, 5e-6))
    pull = (held(leaf, path, np.zeros_like(path), STIFF_STAGE) - path) / 1e-4
    lost = -np.sum(0.5 * (pull[1:] + pull[:-1]) * np.diff(path))
    assert lost > -0.05 * size**2
    if size < 2e-6:
        assert abs(lost) < 0.05 * size**2
        np.testing.assert_allclose(pull, -path, atol=0.05 * size)
