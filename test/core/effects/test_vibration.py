"""Vibration: the sampled system against the continuous one, and superposition."""

import numpy as np
import paper
import pytest
from attrs import evolve
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import signal

from afm_scan_ros.core.effects.vibration import Vibration, VibrationModel, held
from afm_scan_ros.core.errors import InputError

MODEL = paper.vibration()


def test_resonance_and_static_gain_are_the_papers() -> None:
    """Eq. 5: first resonance at 454 Hz, G(0) = 1.07/1.55 V/V."""
    frequency = np.linspace(100.0, 1000.0, 9001)
    gain = np.abs(MODEL.response(2.0 * np.pi * frequency))
    assert frequency[gain.argmax()] == pytest.approx(454.0, abs=0.5)
    assert MODEL.static_gain == pytest.approx(1.07 / 1.55 * paper.SENSITIVITY)


@pytest.mark.parametrize("period", [5e-6, 1e-5, 5e-5, 1e-3])
def test_held_steps_are_answered_as_by_the_continuous_system(period: float) -> None:
    """The continuous response is the sum of its poles' exponentials, from their residues."""
    effect = Vibration(MODEL, period)
    _, response = effect.apply(effect.at_rest(), np.ones(3000))
    time = period * np.arange(3000)
    residues, poles, _ = signal.residue(MODEL.numerator, (*MODEL.denominator, 0.0))
    expected = (residues[:, None] * np.exp(np.outer(poles, time))).sum(axis=0).real
    assert np.abs(response - expected).max() <= 1e-9 * MODEL.static_gain


@pytest.mark.parametrize("samples", [1e-9, 1e-3, 0.1, 1.0])
def test_one_pole_of_any_speed_decays_exponentially(samples: float) -> None:
    """A time constant of so many samples; at 1e-9 the output follows within a sample."""
    effect = Vibration(VibrationModel((1.0,), (2.0 * samples, 1.0)), 2.0)
    _, response = effect.apply(effect.at_rest(), np.ones(20))
    np.testing.assert_allclose(response, -np.expm1(-np.arange(20) / samples), rtol=1e-9)


def test_a_sample_is_taken_before_the_converters_update() -> None:
    effect = Vibration(MODEL, 1e-5)
    _, response = effect.apply(effect.at_rest(), np.array([1.0, 0.0]))
    assert response[0] == 0.0
    assert response[1] > 0.0


def test_the_sampled_response_is_that_of_the_samples() -> None:
    """At 250 Hz and 20 kHz, against a sine fitted to the settled samples."""
    period, omega = 5e-5, 2.0 * np.pi * 250.0
    time = period * np.arange(16000)
    effect = Vibration(MODEL, period)
    _, response = effect.apply(effect.at_rest(), np.sin(omega * time))
    settled, t = response[-8000:], time[-8000:]
    fitted = 2.0 * np.mean(settled * np.exp(-1j * omega * t)) * 1j
    assert fitted == pytest.approx(held(MODEL, period).response(np.array([omega]))[0], rel=1e-6)


def test_a_resonance_without_zeros_is_sampled_exactly() -> None:
    """Golden: the step response of an oscillator, from any textbook."""
    natural, damping, period = 2800.0, 0.01, 1e-5
    model = VibrationModel((0.0, natural**2), (1.0, 2.0 * damping * natural, natural**2))
    effect = Vibration(model, period)
    _, response = effect.apply(effect.at_rest(), np.ones(2000))
    time, root = period * np.arange(2000), np.sqrt(1.0 - damping**2)
    swing = np.cos(natural * root * time) + damping / root * np.sin(natural * root * time)
    assert response == pytest.approx(1.0 - np.exp(-damping * natural * time) * swing, abs=1e-9)


@settings(deadline=None, max_examples=30)
@given(delay=st.floats(0.0, 20.5), seed=st.integers(0, 1000))
def test_a_delay_counts_to_any_part_of_a_sample(delay: float, seed: int) -> None:
    """Held inputs are steps, each answered by the step response of that many samples before."""
    period, inputs = 5e-5, np.random.default_rng(seed).uniform(-1.0, 1.0, 40)
    effect = Vibration(evolve(MODEL, delay=delay * period), period)
    found = effect.apply(effect.at_rest(), inputs)[1]
    residues, poles, _ = signal.residue(MODEL.numerator, (*MODEL.denominator, 0.0))
    ages = np.subtract.outer(np.arange(40), np.arange(40)) - delay
    exponentials = np.exp(np.multiply.outer(np.maximum(ages, 0.0) * period, poles))
    steps = np.where(ages > 0.0, (exponentials @ residues).real, 0.0)
    expected = steps @ np.diff(inputs, prepend=0.0)
    assert np.abs(found - expected).max() <= 1e-9 * MODEL.static_gain


@pytest.mark.parametrize("delay", [3.3e-5, 2e-4, 1.23e-3])
def test_a_delay_turns_the_phase_alone(delay: float) -> None:
    """Of G everywhere; of the samples up to half of their frequency where G has died out."""
    omega = 2.0 * np.pi * np.array([10.0, 454.0, 1000.0])
    late = evolve(MODEL, delay=delay)
    turned = np.exp(-1j * omega * delay)
    assert late.response(omega) == pytest.approx(MODEL.response(omega) * turned, rel=1e-12)
    sampled = held(late, 1e-5).response(omega) / held(MODEL, 1e-5).response(omega)
    assert sampled == pytest.approx(turned, rel=2e-3)


@settings(deadline=None, max_examples=6)
@given(delay=st.floats(0.0, 3e-3), seed=st.integers(0, 1000))
def test_the_inverse_looks_ahead_by_the_delay(delay: float, seed: int) -> None:
    effect = Vibration(evolve(MODEL, delay=delay), 5e-5, preview=12e-3)
    target = paper.smooth_target(seed, 2000, 1e-5)
    state, first = effect.invert(effect.inverse_at_rest(), target)
    inputs = np.concatenate((first, effect.finish(state)))
    found = effect.apply(effect.at_rest(), inputs)[1]
    assert np.abs(found - target).max() <= 1e-3 * 1e-5


def test_a_preview_shorter_than_the_delay_is_refused_with_the_one_it_takes() -> None:
    effect = Vibration(evolve(MODEL, delay=5e-3), 5e-5, preview=4e-3)
    with pytest.raises(InputError, match=r"a preview of 80 samples, 4 ms, .* give at least"):
        effect.inverse_at_rest()


@pytest.mark.parametrize("delay", [-1e-6, float("nan"), float("inf")])
def test_a_delay_that_is_none_is_refused(delay: float) -> None:
    with pytest.raises(InputError, match="delay"):
        VibrationModel(MODEL.numerator, MODEL.denominator, delay)


@settings(deadline=None, max_examples=30)
@given(seed=st.integers(0, 1000), a=st.floats(-3, 3), b=st.floats(-3, 3))
def test_superposition(seed: int, a: float, b: float) -> None:
    effect = Vibration(MODEL, 5e-5)
    u, v = np.random.default_rng(seed).normal(size=(2, 800))
    together = effect.apply(effect.at_rest(), a * u + b * v)[1]
    apart = a * effect.apply(effect.at_rest(), u)[1] + b * effect.apply(effect.at_rest(), v)[1]
    assert np.abs(together - apart).max() <= 1e-12 * (np.abs(apart).max() + MODEL.static_gain)


@pytest.mark.parametrize(
    ("numerator", "denominator", "names"),
    [
        ((1.0, 1.0), (1.0, 1.0), "lower degree"),
        ((1.0,), (1.0, -1.0), "not damped"),
        ((-1.0,), (1.0, 1.0), "not > 0"),
        ((float("inf"),), (1.0, 1.0), "finite"),
    ],
)
def test_polynomials_of_no_scanner_are_refused(
    numerator: tuple[float, ...], denominator: tuple[float, ...], names: str
) -> None:
    with pytest.raises(InputError, match=names):
        VibrationModel(numerator, denominator)
