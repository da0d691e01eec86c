"""Mechanisms of encoder.py, each against the solution of its equation."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from afm_scan_bench.mechanisms import encoder
from afm_scan_bench.mechanisms.encoder import (
    GHOST_SWING,
    MISS_SPACING,
    SCRATCH_ANGLE,
    SCRATCH_OFFSET,
    SPOT_SIZE,
    GhostLight,
    MiscountingEncoder,
    ScratchedPlate,
    UnevenConverter,
)
from afm_scan_ros.core.errors import InputError
from helpers.acting import STEP, TIME, WAVE, act


def test_a_bit_that_weighs_too_much_repeats_every_other_weight() -> None:
    x = np.linspace(-10e-6, 10e-6, 20_001)
    error = act(UnevenConverter(axis="x", weight=2e-6, error=1e-7), x) - x
    inside = np.abs(np.mod(x, 2e-6) - 1e-6) > 2e-9  # off the edges, where rounding decides
    set_ = np.mod(x + 1e-6, 4e-6) > 2e-6
    np.testing.assert_allclose(error[inside], np.where(set_, 1e-7, 0.0)[inside], atol=1e-18)


@settings(deadline=None, max_examples=20)
@given(along=st.floats(-20e-6, 20e-6), across=st.floats(-8e-6, 8e-6))
def test_a_scratch_is_as_deep_all_along(along: float, across: float) -> None:
    plate = ScratchedPlate(axis="x", depth=1e-7)
    x = (SCRATCH_OFFSET + across) * np.cos(SCRATCH_ANGLE) - along * np.sin(SCRATCH_ANGLE)
    y = (SCRATCH_OFFSET + across) * np.sin(SCRATCH_ANGLE) + along * np.cos(SCRATCH_ANGLE)
    read = act(plate, np.array([0.0, x]), np.array([0.0, y]))
    rest = np.exp(-0.5 * (SCRATCH_OFFSET / SPOT_SIZE) ** 2)
    assert read[0] == 0.0
    depth = 1e-7 * (np.exp(-0.5 * (across / SPOT_SIZE) ** 2) - rest)
    assert read[1] - x == pytest.approx(depth, abs=1e-18)


@pytest.mark.parametrize("seed", range(3))
def test_an_encoder_misses_marks_by_chance_and_in_its_direction(seed: int) -> None:
    """Against a simulation miss by miss."""
    encoder = MiscountingEncoder(axis="x", mark=1e-7)
    *_, misses = encoder.at_rest(STEP, np.random.default_rng(seed))
    assert np.diff(misses).mean() == pytest.approx(MISS_SPACING, rel=1e-2)
    path = np.tile(WAVE, 5)
    travelled, missed, expected = 0.0, 0, []
    for before, after in zip(np.append(0.0, path[:-1]), path, strict=True):
        travelled += abs(after - before)
        while travelled > misses[len(expected)]:
            expected.append(1 if after > before else -1)
    missed = np.round((path - act(encoder, path, seed=seed)) / 1e-7).astype(int)
    jumps = np.diff(missed, prepend=0)
    np.testing.assert_array_equal(jumps[jumps != 0], expected)
    assert len(expected) > 10


def test_an_encoder_that_has_missed_as_often_as_it_will_is_refused(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(encoder, "MISSES", 1)
    with pytest.raises(InputError, match="outlasts 1 missed marks"):
        act(MiscountingEncoder(axis="x", mark=1e-9), np.tile(WAVE, 10))


@settings(deadline=None, max_examples=20)
@given(place=st.floats(-20e-6, 20e-6), ghost=st.floats(1e-6, 0.9))
def test_ghost_light_turns_the_angle_and_leaves_no_place_off_for_long(
    place: float, ghost: float
) -> None:
    light = GhostLight(axis="x", period=6e-6, ghost=ghost, shaking=100.0)
    cycle = np.full(2000, place)
    off = act(light, cycle) - place
    assert np.abs(off).max() <= 6e-6 / (2.0 * np.pi) * np.arcsin(ghost) * (1.0 + 1e-6)
    assert abs(off.mean()) < 6e-6 / (2.0 * np.pi) * ghost**2


def test_ghost_light_is_added_to_that_of_the_grating() -> None:
    light = GhostLight(axis="x", period=6e-6, ghost=0.5, shaking=83.0)
    phase = np.random.default_rng(4).uniform(0.0, 2.0 * np.pi)
    theta = GHOST_SWING * np.sin(2.0 * np.pi * 83.0 * TIME + phase)
    seen = np.exp(2j * np.pi * WAVE / 6e-6) + 0.5 * np.exp(1j * theta)
    read = np.exp(2j * np.pi * act(light, WAVE, seed=4) / 6e-6)
    np.testing.assert_allclose(read, seen / np.abs(seen), atol=1e-9)
