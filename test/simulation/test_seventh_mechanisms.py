"""The mechanisms of seventh_sizes.py, each against the solution of its equation."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import integrate

from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.mechanisms import taut_cable
from afm_scan_ros.simulation.mechanisms.attachment import Attachment, Stage
from afm_scan_ros.simulation.mechanisms.base import Insert
from afm_scan_ros.simulation.mechanisms.chattering_valve import PERIOD, STIFF, ChatteringValve
from afm_scan_ros.simulation.mechanisms.crackling_domains import CracklingDomains
from afm_scan_ros.simulation.mechanisms.ghost_light import SWING, GhostLight
from afm_scan_ros.simulation.mechanisms.hum_eliminator import HALF, HumEliminator
from afm_scan_ros.simulation.mechanisms.starved_amplifier import StarvedAmplifier
from afm_scan_ros.simulation.mechanisms.superelastic_leaf import RETURN, SuperelasticLeaf
from afm_scan_ros.simulation.mechanisms.taut_cable import ORDERS, TERMS, Cable, TautCable
from afm_scan_ros.simulation.mechanisms.tugging_hose import SETTLING, TuggingHose

STEP = 5e-6
STAGE, STIFF_STAGE = Stage(2.0 * np.pi * 454.0, 0.012), Stage(1e5, 0.7)
WAVE = 10e-6 * np.sin(np.arange(4000) * 2.0 * np.pi / 1000.0)
TIME = STEP * np.arange(WAVE.size)


def act(insert: Insert, own: Array, seed: int = 0, step: float = STEP) -> Array:
    state = insert.at_rest(step, np.random.default_rng(seed))
    return insert.act(state, own, np.zeros_like(own), step)[1]


def held(attachment: Attachment, x: Array, y: Array, stage: Stage = STAGE) -> Array:
    """Displacement of x (m) with what is attached to it."""
    attached = attachment.attached(stage)
    rest = attached.at_rest(STEP, np.random.default_rng(0))
    return attached.apply(rest, np.vstack((x, y)), STEP)[1][0]


def test_a_hose_pulls_and_relaxes_as_its_elements_do() -> None:
    turning, natural, loss = np.pi / 2.5e-3, STAGE.natural, 2.0 * STAGE.damping * STAGE.natural

    def pulled(t: float, s: Array) -> Array:
        pull = 0.1 * (10e-6 * np.sin(turning * t) + 0.6 * s[2:].mean())
        element = 10e-6 * turning * np.cos(turning * t) - s[2:] / SETTLING
        return np.array([s[1], natural**2 * (pull - s[0]) - loss * s[1], *element])

    found = integrate.solve_ivp(
        pulled, (0.0, TIME[-1]), np.zeros(6), "DOP853", TIME, rtol=1e-8, atol=1e-14
    )
    moved = held(TuggingHose(axis="x", share=0.1, relaxing=0.6), np.zeros_like(WAVE), WAVE)
    np.testing.assert_allclose(moved, found.y[0], atol=2e-4 * np.abs(moved).max())


def test_a_hose_held_at_length_pulls_by_its_share_and_at_once_by_more() -> None:
    y = np.full(1_600_000, 1e-6)
    moved = held(TuggingHose(axis="x", share=0.1, relaxing=0.6), np.zeros_like(y), y, STIFF_STAGE)
    assert moved[-1] == pytest.approx(0.1e-6, rel=1e-3)
    assert moved[30] == pytest.approx(0.16e-6, rel=0.03)


def test_a_cable_swings_as_a_string_does(monkeypatch: pytest.MonkeyPatch) -> None:
    """Against the wave equation's own solution, 1 - k cot k, once it has come to swing."""
    monkeypatch.setattr(taut_cable, "TERMS", 40)
    monkeypatch.setattr(taut_cable, "ORDERS", np.arange(1.0, 41.0))
    cable = TautCable(axis="x", share=1e-3, frequency=345.0, damping=0.3)
    for hertz in (100.0, 345.0, 500.0):
        turned = np.exp(2j * np.pi * hertz * TIME)
        pull = held(cable, turned.imag, np.zeros_like(TIME), Stage(5e5, 0.7)) - turned.imag
        k = np.pi * np.sqrt((hertz / 345.0) ** 2 - 2j * 0.3 * hertz / 345.0)
        settled = (1e-3 * (1.0 - k / np.tan(k)) * turned).imag
        np.testing.assert_allclose(pull[2000:], settled[2000:], atol=0.03 * np.ptp(settled))


@settings(deadline=None, max_examples=10)
@given(seed=st.integers(0, 10_000), share=st.floats(1e-4, 0.1))
def test_a_cable_without_loss_keeps_the_energy(seed: int, share: float) -> None:
    cable = Cable(0, Stage(STAGE.natural, 0.0), share, 2.0 * np.pi * 345.0, 0.0)
    state = np.random.default_rng(seed).normal(0.0, 1e-6, 2 + 2 * TERMS)
    state[1], state[2 + TERMS :] = 0.0, 0.0

    def energy() -> float:
        bends, speeds = state[2 : 2 + TERMS], state[2 + TERMS :]
        stage = 0.5 * ((state[1] / STAGE.natural) ** 2 + state[0] ** 2)
        taut = np.sum((state[0] - 0.5 * np.pi * ORDERS * bends) ** 2)
        moving = 0.25 * np.sum((np.pi * speeds / cable.natural) ** 2)
        return float(stage + share * (taut + moving))

    before = energy()
    cable.integrate(state, np.zeros((2, 4001)), STEP)
    assert energy() == pytest.approx(before, rel=1e-9)


def test_a_starved_amplifier_charges_by_the_root_of_time() -> None:
    starved = StarvedAmplifier(axis="x", power=80e-6, capacitance=100e-9)
    mean = act(starved, np.full(2000, -3.0))
    root = np.minimum(np.sqrt(1600.0 * STEP * (np.arange(2000) + 0.5)), 3.0)
    np.testing.assert_allclose(mean[10:], -root[10:], rtol=1e-3)


@settings(deadline=None, max_examples=20)
@given(seed=st.integers(0, 10_000), power=st.floats(1e-6, 1e-2))
def test_what_the_piezo_stores_grows_by_no_more_than_the_power(seed: int, power: float) -> None:
    drive = np.random.default_rng(seed).normal(0.0, 2.0, 100)
    starved = StarvedAmplifier(axis="x", power=power, capacitance=100e-9)
    before = 0.0
    for u in drive:
        after, mean = starved.act(before, np.array([u]), np.zeros(1), STEP)
        gained = 0.5 * 100e-9 * (after**2 - before**2)
        assert gained <= power * STEP * (1.0 + 1e-9)
        assert after * u >= 0.0
        assert abs(after) <= abs(u)
        assert min(abs(before), abs(u)) * (before * u > 0.0) - 1e-12 <= abs(mean[0]) <= abs(u)
        if abs(after) < abs(u) * (1.0 - 1e-9) and before * u >= 0.0:
            assert gained == pytest.approx(power * STEP)
        before = after


@pytest.mark.parametrize("seed", range(3))
def test_a_valve_goes_round_as_van_der_pol_says(seed: int) -> None:
    time = np.arange(20_000) * 2e-5
    chatter = act(
        ChatteringValve(axis="x", amplitude=1.0, frequency=37.0), 0.0 * time, seed, step=2e-5
    )
    up = np.flatnonzero((chatter[:-1] < 0.0) & (chatter[1:] >= 0.0))
    crossed = time[up] - 2e-5 * chatter[up] / (chatter[up + 1] - chatter[up])
    np.testing.assert_allclose(np.diff(crossed) * 37.0, 1.0, rtol=1e-5)
    found = integrate.solve_ivp(
        lambda _, s: [s[1], STIFF * (1.0 - s[0] ** 2) * s[1] - s[0]],
        (0.0, 5.0 * PERIOD),
        [2.0, 0.0],
        rtol=1e-9,
        atol=1e-9,
        max_step=0.01,
    )
    cycle = found.y[0][found.t > 3.0 * PERIOD]
    assert np.abs(chatter).max() == pytest.approx(np.abs(cycle).max(), rel=1e-4)


def test_a_leaf_turns_and_turns_back_on_a_flag() -> None:
    reach, share = 4e-6, 1e-3
    out = np.linspace(0.0, 10e-6, 1000)
    path = np.concatenate((out, out[::-1], -out, -out[::-1]))
    leaf = SuperelasticLeaf(axis="x", share=share, reaches=(reach,))
    bent = (path - held(leaf, path, np.zeros_like(path), STIFF_STAGE)) / share
    on_the_way_out = np.minimum(out, reach)
    back = np.maximum(np.minimum(out, RETURN * reach), out - (10e-6 - reach))
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


def test_domains_crackle_along_the_way_and_rest_at_rest() -> None:
    crackling = CracklingDomains(axis="x", amplitude=0.1, length=0.4)
    drive = np.concatenate((np.zeros(10), 3.0 * np.sin(np.arange(500) / 50.0)))
    noise = act(crackling, drive) - drive
    np.testing.assert_array_equal(noise[:11], 0.0)
    np.testing.assert_allclose(act(crackling, -drive) + drive, noise, atol=1e-12)
    slowly = np.repeat(drive, 3)
    np.testing.assert_allclose(act(crackling, slowly)[::3], noise + drive, atol=1e-12)
    assert np.std(act(crackling, drive, seed=1) - drive - noise) > 0.05


def test_what_has_crackled_is_forgotten_along_the_way() -> None:
    crackling, way = CracklingDomains(axis="x", amplitude=0.1, length=0.4), np.linspace(0, 4, 41)
    grown = np.mean([(act(crackling, way, seed=s) - way) ** 2 for s in range(1000)], axis=0)
    expected = 2.0 * 0.1**2 * (1.0 - np.exp(-way / 0.4))
    np.testing.assert_allclose(grown[1:].mean(), expected[1:].mean(), rtol=0.1)
    np.testing.assert_allclose(grown[1:4], expected[1:4], rtol=0.15)


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
    theta = SWING * np.sin(2.0 * np.pi * 83.0 * TIME + phase)
    seen = np.exp(2j * np.pi * WAVE / 6e-6) + 0.5 * np.exp(1j * theta)
    read = np.exp(2j * np.pi * act(light, WAVE, seed=4) / 6e-6)
    np.testing.assert_allclose(read, seen / np.abs(seen), atol=1e-9)


@pytest.mark.parametrize("step", [5e-6, 4.7619e-6])
def test_a_box_takes_away_what_turns_its_sign_with_the_mains(step: float) -> None:
    """Against its story told echo by echo."""
    time = step * np.arange(14_000)
    signal = 1e-6 * np.sin(2.0 * np.pi * 30.0 * time) * np.sin(13.0 * time)
    read = act(HumEliminator(axis="x", learning=0.2), signal, step=step)
    told = signal.copy()
    for echo in range(1, 8):
        late = np.interp(time - echo * HALF, time, signal, left=0.0)
        told += 0.2 * 0.8 ** (echo - 1) * (-1.0) ** (echo + 1) * late
    np.testing.assert_allclose(read, told, atol=1e-5 * 1e-6)


def test_a_box_forgets_nothing_of_the_hum_but_its_share() -> None:
    time = STEP * np.arange(20_000)
    hum = np.sin(2.0 * np.pi * 50.0 * time) + 0.3 * np.sin(2.0 * np.pi * 150.0 * time)
    read = act(HumEliminator(axis="x", learning=0.2), hum)
    left = 0.8 ** np.floor((np.arange(20_000) + 0.5) / 2000.0)
    np.testing.assert_allclose(read, left * hum, atol=1e-9)


def test_without_size_they_leave_everything_as_it_was() -> None:
    for none in (
        StarvedAmplifier(axis="x", power=1e3, capacitance=1e-12),
        ChatteringValve(axis="x", amplitude=0.0, frequency=37.0),
        CracklingDomains(axis="x", amplitude=0.0, length=1.0),
        GhostLight(axis="x", period=6e-6, ghost=0.0, shaking=83.0),
        HumEliminator(axis="x", learning=0.0),
    ):
        np.testing.assert_allclose(act(none, WAVE), WAVE, atol=1e-19)
    for free in (
        TuggingHose(axis="x", share=0.0, relaxing=0.6),
        TautCable(axis="x", share=0.0, frequency=345.0, damping=0.01),
        SuperelasticLeaf(axis="x", share=0.0, reaches=(1e-6,)),
    ):
        np.testing.assert_array_equal(held(free, WAVE, WAVE[::-1].copy()), WAVE)


def test_rest_stays_rest() -> None:
    still = np.zeros(500)
    for quiet in (
        StarvedAmplifier(axis="x", power=8e-5, capacitance=1e-7),
        CracklingDomains(axis="x", amplitude=0.1, length=0.4),
        HumEliminator(axis="x", learning=0.1),
    ):
        np.testing.assert_array_equal(act(quiet, still), still)
    for attached in (
        TuggingHose(axis="x", share=0.1, relaxing=0.6),
        TautCable(axis="x", share=0.1, frequency=345.0, damping=0.01),
        SuperelasticLeaf(axis="x", share=0.1, reaches=(1e-6,)),
    ):
        np.testing.assert_array_equal(held(attached, still, still), still)
