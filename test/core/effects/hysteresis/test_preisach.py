"""Preisach: against a sum over relays, wiping-out, congruency, the exact inverse."""

import numpy as np
import paper
import pytest
from attrs import evolve
from hypothesis import given, settings
from hypothesis import strategies as st

from afm_scan_ros.core.effects.hysteresis.everett import (
    BeyondRangeError,
    EverettSurface,
    evenly_spaced,
)
from afm_scan_ros.core.effects.hysteresis.preisach import PAGE, DirectInverse, Preisach

CELLS, FINE = 10, 4
WEIGHTS = paper.cell_weights(CELLS + 1, seed=3)
EFFECT = Preisach(paper.surface_of(WEIGHTS, -4.0, 4.0, 5.5))
seeds = st.integers(0, 2**32 - 1)
drives = st.lists(st.floats(-4.0, 4.0), min_size=1, max_size=40)


def from_saturation(drive: list[float]) -> np.ndarray:
    return EFFECT.apply(EFFECT.saturated(), np.array(drive))[1]


def relay_sum(steps: list[int]) -> np.ndarray:
    """Sum over FINE² relays a cell, all down at first; inputs in steps of a relay's distance.

    Relay (a, b) switches up above a + 1/2 and down below b + 1/2. A diagonal cell's weight lies
    on relays that switch both ways at one input, which is what linear triangles mean.
    """
    spread = np.kron(np.tril(WEIGHTS, -1), np.ones((FINE, FINE))) / FINE**2
    spread += np.diag(np.repeat(np.diag(WEIGHTS), FINE)) / FINE
    spread *= 5.5 / WEIGHTS[np.tril_indices(CELLS)].sum()
    up, down = np.indices(spread.shape)
    state, outputs = -np.ones_like(spread), []
    for u in steps:
        state[up + 0.5 < u] = 1.0
        state[down + 0.5 > u] = -1.0
        outputs.append((spread * state).sum())
    return np.array(outputs)


@settings(deadline=None, max_examples=100)
@given(steps=st.lists(st.integers(0, CELLS * FINE), min_size=1, max_size=40))
def test_the_stack_equals_a_sum_over_relays(steps: list[int]) -> None:
    drive = [-4.0 + 8.0 * s / (CELLS * FINE) for s in steps]
    assert from_saturation(drive) == pytest.approx(relay_sum(steps), abs=1e-12)


@settings(deadline=None, max_examples=50)
@given(before=drives, inner=drives, after=drives)
def test_wiping_out(before: list[float], inner: list[float], after: list[float]) -> None:
    """What happened between two extrema is forgotten when the second is passed."""
    low, high = -3.0, 3.5
    inside = [min(max(u, low), high) for u in inner]
    long = from_saturation([*before, high, low, *inside, high, *after])
    short = from_saturation([*before, high, low, high, *after])
    assert long[-len(after) :] == pytest.approx(short[-len(after) :], abs=1e-12)


@settings(deadline=None, max_examples=50)
@given(one=drives, other=drives, a=st.floats(-4.0, 4.0), b=st.floats(-4.0, 4.0), loop=drives)
def test_congruency(
    one: list[float], other: list[float], a: float, b: float, loop: list[float]
) -> None:
    """Loops between the same inputs have the same shape, whatever went before."""
    low, high = min(a, b), max(a, b)
    path = [low, *(min(max(u, low), high) for u in loop), low]
    shapes = []
    for history in (one, other):
        output = from_saturation([*history, low, high, *path])[-len(path) :]
        shapes.append(output - output[0])
    assert shapes[0] == pytest.approx(shapes[1], abs=1e-12)


@settings(deadline=None, max_examples=50)
@given(drive=drives, seed=seeds)
def test_the_inverse_is_exact(drive: list[float], seed: int) -> None:
    """After any history, and for targets that jump as well as creep."""
    memory, _ = EFFECT.apply(EFFECT.at_rest(), np.array(drive))
    targets = np.random.default_rng(seed).uniform(-5.5, 5.5, 300)
    targets = np.concatenate((targets, np.linspace(targets[-1], -5.5, 300), [5.5, -5.5]))
    targets = np.clip(targets, EFFECT.surface.output_lower, EFFECT.surface.output_upper)
    _, found = EFFECT.invert(memory, targets)
    found = np.clip(found, -4.0, 4.0)
    assert EFFECT.apply(memory, found)[1] == pytest.approx(targets, abs=1e-12)


def test_a_periodic_motion_does_not_fill_the_state() -> None:
    cycle = np.tile([3.0, -2.0, 1.0, -1.0, 0.5], 1000)
    memory, _ = EFFECT.apply(EFFECT.saturated(), cycle)
    assert memory.extrema.shape[1] <= 6


def test_a_depolarised_scanner_rests_between_the_branches_of_its_loop() -> None:
    rising = from_saturation([0.0])[0]
    falling = from_saturation([4.0, 0.0])[-1]
    memory = EFFECT.at_rest()
    assert memory.now[0] == 0.0
    assert rising < memory.now[1] < falling


def test_depolarised_means_equal_steps_either_way_for_a_symmetric_surface() -> None:
    weights = WEIGHTS + WEIGHTS[::-1, ::-1].T
    effect = Preisach(paper.surface_of(weights, -4.0, 4.0, 5.5))
    rest = effect.at_rest()
    steps = [effect.apply(rest, np.array([u]))[1][0] for u in (1.3, -1.3)]
    assert rest.now[1] == pytest.approx(0.0, abs=0.02)
    assert steps[0] == pytest.approx(-steps[1], abs=0.02)


@pytest.mark.parametrize(("value", "limit"), [(4.01, 4.0), (-4.01, -4.0)])
def test_drive_beyond_the_surface_is_refused(value: float, limit: float) -> None:
    with pytest.raises(BeyondRangeError, match="sample 1 of the block") as caught:
        EFFECT.apply(EFFECT.at_rest(), np.array([0.0, value]))
    assert (caught.value.value, caught.value.limit) == (value, limit)


@pytest.mark.parametrize("effect", [EFFECT, DirectInverse(EFFECT.surface)])
def test_targets_beyond_the_surface_are_refused(effect: Preisach | DirectInverse) -> None:
    with pytest.raises(BeyondRangeError, match="sample 0 of the block"):
        effect.invert(effect.inverse_at_rest(), np.array([5.6]))


@settings(deadline=None, max_examples=30)
@given(drive=drives)
def test_the_direct_inverse_is_the_same_operator_exchanged(drive: list[float]) -> None:
    block = np.array(drive)
    direct = DirectInverse(EFFECT.surface)
    rest = direct.inverse_at_rest()
    assert rest.now[1] == pytest.approx(0.0, abs=1e-12)
    assert np.array_equal(direct.invert(rest, block)[1], EFFECT.apply(rest, block)[1])


@pytest.mark.parametrize("size", [1000, 100_000])
def test_a_deep_state_gives_back_each_pair_in_turn(size: int) -> None:
    """Return-point memory, over many pages: on the way out each output comes again."""
    inwards = np.ravel(np.outer(np.linspace(1.0, 0.2, 3000), [3.9, -3.9]))
    drive = np.concatenate((inwards, inwards[-2::-1]))
    memory, outputs = EFFECT.saturated(), []
    for first in range(0, len(drive), size):
        memory, part = EFFECT.apply(memory, drive[first : first + size])
        outputs.append(part)
    found = np.concatenate(outputs)
    assert found == pytest.approx(found[::-1], abs=1e-12)
    assert EFFECT.apply(EFFECT.at_rest(), inwards)[0].extrema.shape[1] > 4 * PAGE
    assert memory.extrema.shape[1] < 10


def with_more_levels() -> EverettSurface:
    """The same surface, some of its cells cut into several: nothing between levels is new."""
    surface = EFFECT.surface
    levels = np.sort(np.concatenate([surface.levels, [-0.35, -0.1, 0.02, 0.03, 0.25, 3.9]]))
    shares = [np.interp(levels, surface.levels, each) for each in np.eye(len(surface.values))]
    between = np.transpose(shares) @ (surface.values - surface.values.T) @ shares
    return evolve(surface, values=np.tril(between, k=-1), uneven=levels)


@settings(max_examples=50, deadline=None)
@given(drive=drives, seed=seeds)
def test_more_levels_where_nothing_bends_change_nothing(drive: list[float], seed: int) -> None:
    uneven = Preisach(with_more_levels())
    small = 0.3 * np.random.default_rng(seed).uniform(-1.0, 1.0, 50)
    inputs = np.concatenate([drive, small])
    outputs = uneven.apply(uneven.at_rest(), inputs)[1]
    np.testing.assert_allclose(outputs, EFFECT.apply(EFFECT.at_rest(), inputs)[1], atol=1e-12)
    back = uneven.invert(uneven.at_rest(), outputs)[1]
    np.testing.assert_allclose(back, inputs, atol=1e-10)


def test_evenly_spaced_levels_are_read_from_uneven_ones() -> None:
    even = evenly_spaced(with_more_levels())
    assert even.uneven is None
    assert len(even.values) == len(with_more_levels().values)
    once = Preisach(even).apply(Preisach(even).saturated(), even.levels)[1]
    np.testing.assert_allclose(once, from_saturation(list(even.levels)), atol=1e-12)
