"""Laws of what effects in feedback add to a coupled structure."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from afm_scan_ros.core.effects.amplitude_softening import LEAST_LEVEL, Softening, averaged
from afm_scan_ros.core.effects.effect_type import Actuators, EffectType
from afm_scan_ros.core.effects.maxwell_slip import DriveSlips, ElongationSlips, resampled
from afm_scan_ros.core.effects.registry import FEEDBACK_EFFECTS, feedback_form
from afm_scan_ros.core.errors import InputError

SAMPLES = 256
ONE = Actuators(np.ones(2), np.eye(2), decay_time=0.1, sample_period=0.01)


def noise(seed: int, lines: int = 100) -> np.ndarray:
    """A period of two channels with lines well below half the sampling rate."""
    rng = np.random.default_rng(seed)
    spectrum = np.zeros((SAMPLES // 2 + 1, 2), dtype=complex)
    spectrum[1:lines] = np.exp(2j * np.pi * rng.random((lines - 1, 2)))
    signal = np.fft.irfft(spectrum, SAMPLES, axis=0)
    return signal / signal.std()


seeds = st.integers(0, 1000)
scales = st.floats(0.1, 10.0)


@given(seed=seeds, scale=scales)
@settings(deadline=None)
def test_slips_scale_with_their_thresholds(seed: int, scale: float) -> None:
    v = noise(seed)
    slips = ElongationSlips(ONE, (0.3, 2.0))
    wider = ElongationSlips(ONE, (0.3 * scale, 2.0 * scale))
    expected = scale * slips.added(v, v, SAMPLES)
    assert_allclose(wider.added(v, scale * v, SAMPLES), expected, atol=1e-12 * scale)


@given(seed=seeds)
@settings(deadline=None)
def test_slips_never_exceed_their_threshold_and_stick_below_it(seed: int) -> None:
    v = noise(seed)
    largest = float(np.abs(v).max())
    slips = ElongationSlips(ONE, (0.3, 1.01 * largest)).added(v, v, SAMPLES)
    assert np.abs(slips[:, [0, 2]]).max() == pytest.approx(0.3)
    assert_allclose(slips[:, [1, 3]], v, atol=1e-12)


@given(seed=seeds)
@settings(deadline=None)
def test_slips_at_the_input_see_between_the_samples(seed: int) -> None:
    """A drive of few lines is sampled finely already: interpolation changes little."""
    v = noise(seed, lines=6)
    each = (slips(ONE, (0.5,)).added(v, v, SAMPLES) for slips in (DriveSlips, ElongationSlips))
    assert_allclose(*each, atol=0.1)


@given(seed=seeds)
@settings(deadline=None)
def test_resampling_keeps_the_samples(seed: int) -> None:
    v = noise(seed)
    fine = resampled(v, 4 * SAMPLES)
    assert_allclose(fine[::4], v, atol=1e-12)
    assert_allclose(resampled(fine, SAMPLES), v, atol=1e-12)


@given(seed=seeds, memory=st.floats(1.0, 1000.0))
@settings(deadline=None)
def test_an_average_keeps_the_mean_and_the_bounds(seed: int, memory: float) -> None:
    power = noise(seed) ** 2
    mean = averaged(power, memory, SAMPLES)
    assert_allclose(mean.mean(axis=0), power.mean(axis=0))
    assert np.all((mean > power.min(axis=0)) & (mean < power.max(axis=0)))
    kept = np.exp(-1.0 / memory)
    assert_allclose(mean[1:], kept * mean[:-1] + (1.0 - kept) * power[1:], atol=1e-12)
    assert_allclose(averaged(power, np.inf, SAMPLES)[0], power.mean(axis=0))


@given(seed=seeds, scale=scales)
@settings(deadline=None)
def test_softening_grows_with_the_logarithm_of_the_level(seed: int, scale: float) -> None:
    v = noise(seed) / noise(seed).std(axis=0)
    added = Softening(ONE).added(v, scale * v, SAMPLES)
    level = 0.5 * np.log(scale**2 + LEAST_LEVEL**2)
    assert_allclose(added, level * np.hstack([scale * v, v]), atol=1e-9)


@given(seed=seeds, run=st.integers(SAMPLES // 4, SAMPLES // 2))
@settings(deadline=None, max_examples=10)
def test_a_run_from_rest_does_not_know_what_follows(seed: int, run: int) -> None:
    one, other = noise(seed), noise(seed + 1)
    other[:run] = one[:run]
    for element in (Softening(ONE), ElongationSlips(ONE, (0.3,))):
        found, same = (element.added(one, each, run)[:run] for each in (one, other))
        assert_allclose(found, same, atol=1e-12)


@pytest.mark.parametrize("effect", FEEDBACK_EFFECTS, ids=lambda each: each.name)
def test_values_lie_within_their_bounds(effect: EffectType) -> None:
    form = effect.feedback
    for parameter, value in zip(form.parameters, form.values(ONE), strict=True):
        assert parameter.lower < value < parameter.upper


def test_an_unknown_effect_is_named_with_those_known() -> None:
    with pytest.raises(
        InputError, match="'delay': choose among amplitude_softening, maxwell_slip, "
    ):
        feedback_form("delay")
