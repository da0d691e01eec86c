"""Resonances added, moved, and softened by their own motion."""

from itertools import pairwise

import numpy as np
import paper
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.effects.base import Cascade
from afm_scan_ros.core.effects.hysteretic_stiffness import (
    ELEMENTS,
    KNOTS,
    SHARES,
    SPREAD,
    HystereticStiffness,
    spectrum,
)
from afm_scan_ros.core.effects.registry import effect_type
from afm_scan_ros.core.effects.vibration import (
    LARGEST_TAIL,
    Vibration,
    VibrationModel,
    first_resonance,
)
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.model import InverseSettings

CHAIN = Chain(paper.axis())
BASE = CHAIN.model.vibration
PERIOD = 2e-5
OMEGA = 2.0 * np.pi * np.linspace(0.0, 5000.0, 400)


def vibration(name: str, kind: str, *values: float) -> VibrationModel:
    return effect_type(name).form(kind).insert(CHAIN, np.array(values)).model.vibration


modes = {
    "size": st.floats(-0.4, 0.5),
    "frequency": st.floats(50.0, 15e3),
    "damping": st.floats(0.002, 0.6),
}


@settings(deadline=None, max_examples=40)
@given(**modes)
def test_an_added_mode_responds_as_its_equation(
    size: float, frequency: float, damping: float
) -> None:
    s, w = 1j * OMEGA, 2.0 * np.pi * frequency
    mode = s**2 + 2.0 * damping * w * s + w**2
    series = vibration("extra_resonance", "series_mode", size, frequency, damping)
    parallel = vibration("extra_resonance", "parallel", size, frequency, damping)
    base = BASE.response(OMEGA)
    for found, expected in (
        (series, base * (1.0 + size * s**2 / mode)),
        (parallel, base + size * BASE.static_gain * w**2 / mode),
    ):
        assert np.abs(found.response(OMEGA) - expected).max() <= 1e-9 * np.abs(expected).max()
    assert series.static_gain == pytest.approx(BASE.static_gain, rel=1e-12)


@settings(deadline=None, max_examples=40)
@given(frequency=modes["frequency"], damping=modes["damping"])
def test_a_mode_whose_sensor_rides_on_it_is_in_series(frequency: float, damping: float) -> None:
    """It follows its support: q'' + 2 d w (q' - x') + w^2 (q - x) = 0."""
    s, w = 1j * OMEGA, 2.0 * np.pi * frequency
    follows = (2.0 * damping * w * s + w**2) / (s**2 + 2.0 * damping * w * s + w**2)
    found = vibration("extra_resonance", "series_mode", -1.0, frequency, damping).response(OMEGA)
    expected = BASE.response(OMEGA) * follows
    assert np.abs(found - expected).max() <= 1e-9 * np.abs(expected).max()


@settings(deadline=None, max_examples=40)
@given(mass=st.floats(0.0, 1.0), frequency=modes["frequency"], damping=modes["damping"])
def test_an_absorber_mode_is_that_of_two_masses_on_springs(
    mass: float, frequency: float, damping: float
) -> None:
    """Both masses' equations of motion, solved for the stage and the mass that rides on it."""
    s, w, d = 1j * OMEGA, 2.0 * np.pi * frequency, first_resonance(BASE)
    own, link = np.polyval(d.factor, s), 2.0 * damping * w * s + w**2
    equations = np.array([[own + mass * link, -mass * link], [-link, s**2 + link]])
    forced = np.array([[1.0], [0.0]])
    stage = np.linalg.solve(equations.transpose(2, 0, 1), forced[np.newaxis])[:, 0, 0]
    found = vibration("extra_resonance", "absorber_mode", mass, frequency, damping).response(OMEGA)
    expected = BASE.response(OMEGA) * own * stage
    assert np.abs(found - expected).max() <= 1e-9 * np.abs(expected).max()


@pytest.mark.parametrize(
    ("kind", "mass"), [("series_mode", 0.2), ("series_mode", -1.0), ("absorber_mode", 0.5)]
)
def test_what_multiplies_the_motion_leaves_the_inverse_s_own_error_as_it_was(
    kind: str, mass: float
) -> None:
    """And as long a preview: the modified trajectory is that of the model without it."""
    values = np.array([mass, 800.0, 0.02])
    loaded = effect_type("extra_resonance").form(kind).insert(CHAIN, values)
    target = 1e-6 * np.repeat([0.0, 1.0, 0.0], (4000, 30, 8000))
    before, after = (
        (vibration, vibration.apply(vibration.at_rest(), vibration.inverse.invert_whole(target))[1])
        for vibration in (chain.vibration(PERIOD, InverseSettings()) for chain in (CHAIN, loaded))
    )
    assert np.abs(before[1] - target).max() > 0.1e-6
    assert np.abs(after[1] - before[1]).max() <= 1e-6 * 1e-6
    needed = [each.inverse.kernel.preview_needed(LARGEST_TAIL) for each, _ in (before, after)]
    assert needed[1] <= 1.5 * needed[0]


@settings(deadline=None, max_examples=40)
@given(share=st.floats(0.0, 0.3), frequency=modes["frequency"], damping=modes["damping"])
def test_a_coupled_mode_loads_and_couples_as_a_mass_between_two_axes(
    share: float, frequency: float, damping: float
) -> None:
    """X pulled by 2 share (q - x/2), q carried by (x + y)/2 on its spring: both solved for x."""
    s, w, d = 1j * OMEGA, 2.0 * np.pi * frequency, first_resonance(BASE)
    own = np.polyval(d.factor, s) / d.omega**2
    mode = (s**2 + 2.0 * damping * w * s + w**2) / w**2
    equations = np.array([[own + share, -2.0 * share + 0.0 * s], [-0.5 + 0.0 * s, mode]])
    form = effect_type("cross_coupling").form("coupled_mode")
    chain = form.insert(CHAIN, np.array([share, frequency, damping]))
    crossing, structure = chain.coupling[0].parameters
    for piezo, other, found in (
        (own, 0.0 * s, chain.model.vibration.response(OMEGA) / BASE.response(OMEGA)),
        (0.0 * s, 0.5 + 0.0 * s, crossing * structure.response(OMEGA)),
    ):
        forced = np.stack((piezo, other)).T[:, :, np.newaxis]
        moved = np.linalg.solve(equations.transpose(2, 0, 1), forced)[:, 0, 0]
        assert np.abs(found - moved).max() <= 1e-9 * np.abs(moved).max() + 1e-15


@pytest.mark.parametrize("kind", ["series_mode", "parallel"])
@pytest.mark.parametrize("frequency", [5.0, 700.0, 2e4])
def test_an_added_mode_is_sampled_exactly(kind: str, frequency: float) -> None:
    """Far below and far above the others too: the sum of its poles' exponentials."""
    period, w, damping = 2e-5, 2.0 * np.pi * frequency, 0.01
    model = vibration("extra_resonance", kind, 0.1, frequency, damping)
    effect = Vibration(model, period)
    found = effect.apply(effect.at_rest(), np.ones(3000))[1]
    poles = np.append(np.roots(BASE.denominator), w * (-damping + 1j * np.sqrt(1.0 - damping**2)))
    poles = np.concatenate((poles, poles[-1:].conj(), [0.0]))
    apart = poles[:, np.newaxis] - poles + np.eye(len(poles))
    residues = np.polyval(model.numerator, poles) / model.denominator[0] / apart.prod(axis=1)
    expected = (residues[:, np.newaxis] * np.exp(np.outer(poles, period * np.arange(3000)))).sum(0)
    assert np.abs(found - expected.real).max() <= 1e-8 * BASE.static_gain


def test_a_shifted_resonance_keeps_its_gain_at_rest() -> None:
    shifted = vibration("parameter_shift", "resonance", 0.9, 2.0)
    old, new = first_resonance(BASE), first_resonance(shifted)
    assert new.omega == pytest.approx(0.9 * old.omega, rel=1e-9)
    assert new.damping == pytest.approx(2.0 * old.damping, rel=1e-9)
    assert shifted.static_gain == pytest.approx(BASE.static_gain, rel=1e-12)
    assert np.sort(np.roots(new.rest)) == pytest.approx(np.sort(np.roots(old.rest)), rel=1e-9)


@given(stiffness=st.floats(0.5, 2.0))
def test_a_softer_stage_has_the_mass_and_the_loss_that_it_had(stiffness: float) -> None:
    """Forced by what the piezo gave before, less what the softer spring gives back less."""
    softer, d = vibration("parameter_shift", "stiffness", stiffness), first_resonance(BASE)
    before = BASE.response(OMEGA)
    moved = before / (1.0 + (stiffness - 1.0) * d.omega**2 / np.polyval(d.factor, 1j * OMEGA))
    assert np.abs(softer.response(OMEGA) - moved).max() <= 1e-9 * np.abs(moved).max()
    assert softer.static_gain == pytest.approx(BASE.static_gain / stiffness, rel=1e-9)


@pytest.mark.parametrize("frequency", [150.0, 330.0])
def test_a_light_coupled_mode_below_the_resonance_is_not_taken_for_it(frequency: float) -> None:
    loaded = vibration("cross_coupling", "coupled_mode", 0.03, frequency, 0.02)
    assert first_resonance(loaded).omega == pytest.approx(first_resonance(BASE).omega, rel=0.05)


def test_a_model_without_resonance_has_none_to_shift() -> None:
    with pytest.raises(InputError, match="no resonance"):
        first_resonance(VibrationModel((1.0,), (1.0, 3.0, 1.0)))


SPRING = VibrationModel((1e-5 * 3000.0**2,), (1.0, 2.0 * 0.02 * 3000.0, 3000.0**2))


def structure(share: float, threshold: float, balance: float) -> Cascade:
    """Resonance whose spring yields, from its drive (V) on."""
    material = threshold * SPREAD, np.full(ELEMENTS, share / ELEMENTS), balance
    yields = HystereticStiffness(first_resonance(SPRING), material, PERIOD)
    return Cascade((Vibration(SPRING, PERIOD), yields))


def test_a_yielding_spring_moves_as_its_equation_of_motion() -> None:
    """Against the oscillator integrated with each play element, between updates too."""
    share, threshold, balance = 0.2, 2e-6, 0.3
    drive = np.repeat([1.0, -0.6, 0.3, 0.0], 30)
    thresholds, omega, fine = threshold * SPREAD, 3000.0, 40
    plays, state, expected = np.zeros(len(SPREAD)), np.zeros(2), []

    def motion(_: float, now: np.ndarray, force: float) -> list[float]:
        return [now[1], omega**2 * (force - now[0]) - 2.0 * 0.02 * omega * now[1]]

    for u in drive:
        expected.append(state[0])
        for _ in range(fine):
            force = 1e-5 * u + share * (plays.mean() - balance * state[0])
            step = solve_ivp(motion, (0.0, PERIOD / fine), state, args=(force,), max_step=PERIOD)
            state = step.y[:, -1]
            plays = np.clip(plays, state[0] - thresholds, state[0] + thresholds)
    effect = structure(share, threshold, balance)
    found = effect.apply(effect.at_rest(), drive)[1]
    assert np.abs(found - expected).max() <= 2e-3 * np.abs(expected).max()


def swing(effect: Cascade, height: float) -> tuple[float, float]:
    """Frequency (rad/s) and damping of the free swing after a drive (V) is let go."""
    drive = np.concatenate((np.full(20_000, height), np.zeros(2000)))
    free = effect.apply(effect.at_rest(), drive)[1][20_000:]
    free = free - free[-1000:].mean()
    crossings = np.flatnonzero(np.diff(np.sign(free)))[:5]
    peaks = [np.abs(free[a:b]).max() for a, b in pairwise(crossings)]
    decay = -np.polyfit(np.arange(len(peaks)), np.log(peaks), 1)[0] / np.pi
    return np.pi * 4.0 / ((crossings[4] - crossings[0]) * PERIOD), decay


def test_a_large_swing_is_slower_and_dies_sooner_than_a_small_one() -> None:
    """Golden: far below the thresholds nothing yields; far above, the share k of the stiffness."""
    effect = structure(0.2, 1e-6, 0.0)
    small, middle, large = (swing(effect, height) for height in (1e-4, 0.3, 300.0))
    assert small[0] == pytest.approx(3000.0, rel=5e-3)
    assert large[0] == pytest.approx(3000.0 * np.sqrt(0.8), rel=5e-3)
    assert large[0] < middle[0] < small[0]
    assert middle[1] > 1.2 * max(small[1], large[1])


def test_a_loop_with_balance_one_is_stiffer_where_it_is_small() -> None:
    effect = structure(0.2, 1e-6, 1.0)
    assert swing(effect, 1e-4)[0] == pytest.approx(3000.0 * np.sqrt(1.2), rel=5e-3)
    assert swing(effect, 300.0)[0] == pytest.approx(3000.0, rel=5e-3)


@settings(deadline=None, max_examples=20)
@given(
    share=st.floats(0.0, 0.3),
    threshold=st.floats(1e-8, 1e-5),
    balance=st.floats(0.0, 1.0),
    seed=st.integers(0, 1000),
)
def test_the_inverse_of_a_yielding_spring_is_as_exact_as_samples_are_dense(
    share: float, threshold: float, balance: float, seed: int
) -> None:
    """Of the targets' bend from one sample to the next, a share."""
    material = threshold * SPREAD, np.full(ELEMENTS, share / ELEMENTS), balance
    effect = HystereticStiffness(first_resonance(BASE), material, PERIOD)
    target = paper.smooth_target(seed, 2000, 2e-5)
    before = effect.invert(effect.inverse_at_rest(), target)[1]
    found = effect.apply(effect.at_rest(), before)[1]
    assert np.abs(found - target).max() <= 1e-5 * np.abs(target).max()


@settings(deadline=None, max_examples=20)
@given(shares=st.lists(st.floats(0.0, SHARES[0].upper), min_size=len(KNOTS), max_size=len(KNOTS)))
def test_a_spectrum_yields_by_each_knots_share(shares: list[float]) -> None:
    """Pulled beyond a knot, no element holds that a share about a nearer one has."""
    thresholds, found = spectrum(shares)
    assert found.sum() == pytest.approx(sum(shares), abs=1e-12)
    assert found.min() >= 0.0
    for near, knot, far in zip((0.0, *KNOTS), KNOTS, (*KNOTS[1:], np.inf), strict=False):
        alone = np.array(KNOTS) == knot
        about = thresholds[spectrum(alone.astype(float))[1] > 0.0]
        assert near < about.min() <= knot * (1.0 + 1e-9)
        assert knot * (1.0 - 1e-9) <= about.max() < far
