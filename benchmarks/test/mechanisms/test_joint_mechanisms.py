"""Mechanisms of joint.py, each against the solution of its equation."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import integrate

from afm_scan_bench.mechanisms.joint import (
    OIL_FILM,
    SNAP_TIME,
    FloodedJoint,
    RoundHole,
    SlidingSample,
    SnappingLeaf,
    SpringyJoint,
)
from afm_scan_ros.core.types import Array
from helpers.acting import STEP, TIME, WAVE, act


def test_a_spring_passes_its_share_within_the_play() -> None:
    joint = SpringyJoint(axis="x", gap=100e-9, share=0.2)
    moved = act(joint, np.array([50e-9, 300e-9, 200e-9]))
    np.testing.assert_allclose(moved, [10e-9, 220e-9, 200e-9], atol=1e-18)


def test_a_sample_slides_on_as_far_as_friction_lets_it() -> None:
    """Stopped from 3 mm/s at once, it slides by v^2 / 2 grip; stopped gently it does not."""
    ramp = np.minimum(3e-3 * TIME, 3e-3 * TIME[1000])
    start = act(SlidingSample(axis="x", grip=2.0, room=1.0), ramp) - ramp
    assert start[999] == pytest.approx(-(3e-3**2) / 4.0, rel=1e-2)
    assert start[-1] == pytest.approx(0.0, abs=3e-8)
    gentle = 1e-6 * (1.0 - np.cos(1e3 * TIME))  # 1 m/s^2 at most
    np.testing.assert_allclose(act(SlidingSample(axis="x", grip=1.02, room=1.0), gentle), gentle)


@settings(deadline=None, max_examples=20)
@given(grip=st.floats(0.01, 10.0), room=st.floats(1e-9, 1e-5))
def test_a_sample_stays_in_its_recess(grip: float, room: float) -> None:
    slid = act(SlidingSample(axis="x", grip=grip, room=room), WAVE) - WAVE
    assert np.abs(slid).max() <= room * (1.0 + 1e-9)


def test_films_take_the_sample_along_by_reynolds() -> None:
    joint, gap, travel = FloodedJoint(axis="x", gap=1e-7), 1e-7, np.linspace(0.0, 3e-7, 301)

    def follow(x: float, sample: Array) -> Array:
        thickness = 1.0 - (x - sample) / gap
        return np.asarray(OIL_FILM / (thickness**3 + OIL_FILM))

    forth = integrate.solve_ivp(
        follow, (0.0, 3e-7), [0.0], "DOP853", travel, rtol=1e-10, atol=1e-16
    )
    np.testing.assert_allclose(act(joint, travel), forth.y[0], atol=1e-14)
    there_and_back = act(joint, np.concatenate((travel, travel[::-1])))
    lost = there_and_back[:301][::-1] - there_and_back[301:]
    assert lost[-1] < 0.0 < gap < -lost.min() < 2.0 * gap


@settings(deadline=None, max_examples=20)
@given(seed=st.integers(0, 10_000), gap=st.floats(1e-9, 1e-5))
def test_a_flooded_joint_knows_no_speed_and_never_touches(seed: int, gap: float) -> None:
    rng = np.random.default_rng(seed)
    turns = np.cumsum(rng.normal(0.0, 1e-6, 50))
    fine = np.interp(np.arange(0.0, 49.01, 0.1), np.arange(50), turns)
    joint = FloodedJoint(axis="x", gap=gap)
    sample = act(joint, fine)
    np.testing.assert_allclose(sample[::10], act(joint, turns), atol=1e-9 * 1e-6)
    assert np.all(np.abs(fine - sample) < gap)


def test_a_leaf_snaps_where_its_rest_ends() -> None:
    leaf, there = SnappingLeaf(axis="x", throw=1e-7, reach=1e-5), np.linspace(-9e-6, 9e-6, 200_000)
    path = np.concatenate((np.linspace(0.0, -9e-6, 1000), there, there[::-1]))
    w = (act(leaf, path) - path) / 1e-7 - 1.0
    up, down = w[1000:201_000], w[201_000:][::-1]
    fold = 2.0 / np.sqrt(27.0) * 1e-5
    snaps = there[np.argmax(up > 0.0)], -there[np.argmax(down > 0.0)]
    np.testing.assert_array_less(fold, snaps)
    np.testing.assert_array_less(snaps, 1.05 * fold)  # it takes its time to leave where it was


def test_a_leaf_follows_its_equation() -> None:
    leaf = SnappingLeaf(axis="x", throw=1e-7, reach=1e-5)

    def snap(t: float, w: Array) -> Array:
        return np.asarray((w - w**3 + np.interp(t, TIME, WAVE) / 1e-5) / SNAP_TIME)

    found = integrate.solve_ivp(
        snap, (0.0, TIME[-1]), [-1.0], "DOP853", TIME, max_step=STEP, rtol=1e-9, atol=1e-12
    )
    np.testing.assert_allclose(act(leaf, WAVE), WAVE + 1e-7 * (found.y[0] + 1.0), atol=1e-13)


def test_a_holder_is_swept_along_by_the_pin() -> None:
    """Against Moreau's catching up, which takes the nearest place left after each small step."""
    gap = 3e-6
    x, y = WAVE[:1500], 6e-6 * np.cos(np.arange(1500) / 130.0) - 6e-6
    fine = np.linspace(0, 1499, 1499 * 100 + 1)
    holder, caught = 0.0j, []
    for pin in np.interp(fine, np.arange(1500), x) + 1j * np.interp(fine, np.arange(1500), y):
        away = pin - holder
        holder = pin - away * min(1.0, gap / max(abs(away), 1e-30))
        caught.append(holder.real)
    np.testing.assert_allclose(act(RoundHole(axis="x", gap=gap), x, y), caught[::100], atol=2e-9)


@settings(deadline=None, max_examples=20)
@given(seed=st.integers(0, 10_000), gap=st.floats(1e-9, 1e-5))
def test_a_round_hole_knows_no_speed_and_is_a_play_along_one_axis(seed: int, gap: float) -> None:
    rng = np.random.default_rng(seed)
    turns, across = np.cumsum(rng.normal(0.0, 1e-6, (2, 50)), axis=1)
    fine = np.arange(0.0, 49.01, 0.1)
    joint, known = RoundHole(axis="x", gap=gap), np.arange(50)
    slowly = act(joint, np.interp(fine, known, turns), np.interp(fine, known, across))
    np.testing.assert_allclose(slowly[::10], act(joint, turns, across), atol=1e-9 * 1e-6)
    assert np.all(np.abs(turns - slowly[::10]) <= gap * (1.0 + 1e-9))
    place, played = 0.0, []
    for x in turns:
        place = min(max(place, x - gap), x + gap)
        played.append(place)
    np.testing.assert_allclose(act(joint, turns), played, atol=1e-18)
