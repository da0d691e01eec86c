"""Lag, ringing and slew limit against the voltage traced between the converter's updates."""

import numpy as np
import paper
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import expm

from afm_scan_ros.core.effects.extra_resonance import ringing_drive, starts_drive
from afm_scan_ros.core.effects.input_lag import lagging_drive
from afm_scan_ros.core.effects.residual_features import ResidualFeatures
from afm_scan_ros.core.effects.slew_limit import SlewLimit
from afm_scan_ros.core.errors import SampleError

PERIOD = 2e-5
FINE = 4000
lags = st.floats(1e-6, 1e-2)
drives = st.lists(st.floats(-4.0, 4.0), min_size=1, max_size=12)


@settings(deadline=None, max_examples=30)
@given(lag=lags, drive=drives)
def test_a_lag_gives_the_mean_over_each_hold(lag: float, drive: list[float]) -> None:
    """Golden: v = u + (v(0) - u) e^{-t/τ} within a hold, averaged by the midpoint rule."""
    end, means = 0.0, []
    time = (np.arange(FINE) + 0.5) * PERIOD / FINE
    for u in drive:
        means.append(np.mean(u + (end - u) * np.exp(-time / lag)))
        end = u + (end - u) * np.exp(-PERIOD / lag)
    effect = lagging_drive(lag, PERIOD)
    found = effect.apply(effect.at_rest(), np.array(drive))[1]
    assert found == pytest.approx(means, abs=1e-4 * np.abs(drive).max() + 1e-12)


@settings(deadline=None, max_examples=30)
@given(lag=lags, frequency=st.floats(20.0, 1000.0))
def test_a_lag_delays_and_attenuates_as_its_transfer_function(lag: float, frequency: float) -> None:
    """Golden: 1/(1 + jωτ), up to second order in ωT."""
    omega = 2.0 * np.pi * frequency
    settling = 2 + int(20.0 * lag / PERIOD)
    time = PERIOD * np.arange(settling + round(5.0 / (frequency * PERIOD)))
    effect = lagging_drive(lag, PERIOD)
    found = effect.apply(effect.at_rest(), np.sin(omega * time))[1][settling:]
    expected = (np.exp(1j * omega * time) / (1.0 + 1j * omega * lag)).imag[settling:]
    assert np.abs(found - expected).max() <= 0.2 * (omega * PERIOD) ** 2 + 1e-8


@settings(deadline=None, max_examples=30)
@given(lag=lags, seed=st.integers(0, 1000))
def test_the_inverse_of_a_lag_never_rings(lag: float, seed: int) -> None:
    """After a kink of the target its drive lies on the two straight lines within two samples."""
    slopes = np.random.default_rng(seed).uniform(-100.0, 100.0, 2)
    time = PERIOD * np.arange(-50, 50)
    target = np.where(time < 0.0, slopes[0], slopes[1]) * time - slopes[0] * time[0]
    effect = lagging_drive(lag, PERIOD)
    found = effect.invert(effect.inverse_at_rest(), target)[1]
    expected = target + lag * np.where(time < 0.0, slopes[0], slopes[1])
    straight = np.r_[3:50, 53:100]
    assert found[straight] == pytest.approx(expected[straight], abs=1e-9)
    assert np.abs(found[3:]).max() <= np.abs(expected).max() + np.ptp(slopes) * (lag + PERIOD)


@settings(deadline=None, max_examples=20)
@given(lag=st.floats(1e-6, 1e-3), seed=st.integers(0, 1000))
def test_the_inverse_of_a_lag_is_exact_up_to_the_samples_spacing(lag: float, seed: int) -> None:
    target = paper.smooth_target(seed, 1000, 4.0)
    effect = lagging_drive(lag, PERIOD)
    drive = effect.invert(effect.inverse_at_rest(), target)[1]
    found = effect.apply(effect.at_rest(), drive)[1]
    assert np.abs(found - target).max() <= 0.5 * np.abs(np.diff(target, 2)).max() + 1e-12


ringings = st.floats(2e-4, 2e-2)
dampings = st.floats(1e-3, 0.5)


@settings(deadline=None, max_examples=30)
@given(ringing=ringings, damping=dampings, drive=drives)
def test_a_ringing_gives_the_mean_over_each_hold(
    ringing: float, damping: float, drive: list[float]
) -> None:
    """Golden: the equation in steps of a hundredth of a hold, each by its matrix exponential."""
    omega, fine = 2.0 * np.pi / ringing, PERIOD / 100.0
    swing = expm(np.array([[0.0, 1.0], [-(omega**2), -2.0 * damping * omega]]) * fine)
    state, means = np.zeros(2), []
    for u in drive:
        inside = []
        for _ in range(100):
            before = state[0]
            state = np.array([u, 0.0]) + swing @ (state - [u, 0.0])
            inside.append(0.5 * (before + state[0]))
        means.append(np.mean(inside))
    effect = ringing_drive(ringing, damping, PERIOD)
    found = effect.apply(effect.at_rest(), np.array(drive))[1]
    assert found == pytest.approx(means, abs=2e-4 * np.abs(drive).max() + 1e-12)


@settings(deadline=None, max_examples=30)
@given(ringing=ringings, damping=dampings, seed=st.integers(0, 1000))
def test_the_inverse_of_a_ringing_never_rings(ringing: float, damping: float, seed: int) -> None:
    """After a kink of the target its drive lies on the two straight lines within four samples."""
    slopes = np.random.default_rng(seed).uniform(-100.0, 100.0, 2)
    time = PERIOD * np.arange(-50, 50)
    target = np.where(time < 0.0, slopes[0], slopes[1]) * time - slopes[0] * time[0]
    effect = ringing_drive(ringing, damping, PERIOD)
    found = effect.invert(effect.inverse_at_rest(), target)[1]
    lag = damping * ringing / np.pi
    expected = target + lag * np.where(time < 0.0, slopes[0], slopes[1])
    straight = np.r_[5:50, 55:100]
    assert found[straight] == pytest.approx(expected[straight], abs=1e-8)


@settings(deadline=None, max_examples=30)
@given(ringing=st.one_of(st.just(0.0), ringings), damping=dampings, seed=st.integers(0, 1000))
def test_the_inverse_of_a_ringing_is_exact_up_to_the_samples_spacing(
    ringing: float, damping: float, seed: int
) -> None:
    """What it gives is the target but for its third differences, wherever it begins and however."""
    target = paper.smooth_target(seed, 1000, 4.0)
    effect = ringing_drive(ringing, damping, PERIOD)
    drive = effect.invert(effect.inverse_at_rest(), target)[1]
    found = effect.apply(effect.at_rest(), drive)[1]
    began = np.concatenate((np.zeros(3), target))
    assert np.abs(found - target).max() <= 2.0 * np.abs(np.diff(began, 3)).max() + 1e-8


@settings(deadline=None, max_examples=8)
@given(ringing=st.floats(4e-4, 5e-3), damping=st.floats(0.005, 0.1), size=st.integers(3, 9))
def test_a_ringing_is_begun_near_its_period_from_a_few_lines(
    ringing: float, damping: float, size: int
) -> None:
    """A motion that repeats a hundred times a second, of a few harmonics as high as each other."""
    time = PERIOD * np.arange(10_000)
    still = sum(np.cos(2.0 * np.pi * 100.0 * k * time + k * k) for k in range(1, 2 * size, 2))
    effect = ringing_drive(ringing, damping, PERIOD)
    moved = effect.apply(effect.at_rest(), still)[1]
    features = ResidualFeatures(PERIOD, still, moved, moved - still, still, ())
    begun = [period for period, _ in starts_drive(features)]
    assert min(abs(np.log(period / ringing)) for period in begun) <= 0.05


@settings(deadline=None, max_examples=30)
@given(slope=st.floats(1e3, 1e6), drive=drives)
def test_a_slew_limit_gives_the_mean_over_each_hold(slope: float, drive: list[float]) -> None:
    """Golden: the voltage moves at the slope until it is there, averaged by the midpoint rule."""
    end, means = 0.0, []
    time = (np.arange(FINE) + 0.5) * PERIOD / FINE
    for u in drive:
        means.append(np.mean(end + np.clip(u - end, -slope * time, slope * time)))
        end += np.clip(u - end, -slope * PERIOD, slope * PERIOD)
    effect = SlewLimit(slope, slope, 0.0, PERIOD)
    found = effect.apply(effect.at_rest(), np.array(drive))[1]
    assert found == pytest.approx(means, abs=1e-3 * min(slope * PERIOD, 8.0))


@settings(deadline=None, max_examples=30)
@given(rising=st.floats(1e2, 1e5), falling=st.floats(1e2, 1e5), tau=st.floats(0.01, 1.0))
def test_a_resistance_discharges_what_falls_towards_the_supply(
    rising: float, falling: float, tau: float
) -> None:
    """Golden: (v ± S τ) e^(-t/τ) ∓ S τ to either side, until the drive is reached."""
    drive = np.repeat([3.0, -3.0, 1.0], 400)
    effect = SlewLimit(rising, falling, 1.0 / tau, PERIOD)
    found = effect.apply(effect.at_rest(), drive)[1]
    v, ends = 0.0, [0.0]
    for u in drive:
        supply = rising * tau if u > v else -falling * tau
        moved = supply + (v - supply) * np.exp(-PERIOD / tau)
        v = min(moved, u) if u > v else max(moved, u)
        ends.append(v)
    means = 0.5 * np.add(ends[1:], ends[:-1])
    assert found == pytest.approx(means, abs=6.0 * PERIOD / tau + max(rising, falling) * PERIOD)


@pytest.mark.parametrize("share", [0.1, 0.5, 0.7])
def test_the_inverse_of_a_slew_limit_is_exact_on_ramps(share: float) -> None:
    slope = 1e3
    target = share * slope * PERIOD * np.arange(100)
    effect = SlewLimit(slope, slope, 0.0, PERIOD)
    drive = effect.invert(effect.inverse_at_rest(), target)[1]
    assert effect.apply(effect.at_rest(), drive)[1][2:] == pytest.approx(target[2:], abs=1e-9)


@pytest.mark.parametrize(("way", "limit"), [(1.0, 1e3), (-1.0, 2e3)])
def test_each_way_is_refused_by_its_own_limit(way: float, limit: float) -> None:
    effect = SlewLimit(1e3, 2e3, 0.0, PERIOD)
    ramp = way * PERIOD * np.arange(1.0, 10.0)
    effect.invert(effect.inverse_at_rest(), 0.99 * limit * ramp)
    with pytest.raises(SampleError, match=f"limit of {limit:g} V/s"):
        effect.invert(effect.inverse_at_rest(), 1.01 * limit * ramp)


def test_what_is_too_steep_is_refused_by_sample_slope_and_limit() -> None:
    effect = SlewLimit(1e3, 1e3, 0.0, PERIOD)
    state, _ = effect.invert(effect.inverse_at_rest(), np.full(10, 0.01))
    with pytest.raises(SampleError, match=r"sample 2 .* 1500 V/s, beyond .* 1000 V/s") as caught:
        effect.invert(state, np.array([0.01, 0.02, 0.05]))
    assert caught.value.sample == 2
    with pytest.raises(SampleError):
        effect.invert(state, np.array([np.nan]))


def test_a_slow_ringing_settles_where_it_is_driven_at_a_high_rate() -> None:
    effect = ringing_drive(0.05, 0.5, 1e-6)
    found = effect.apply(effect.at_rest(), np.ones(1_000_000))[1]
    assert found[-1] == pytest.approx(1.0, abs=1e-11)
