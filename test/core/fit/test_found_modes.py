"""Modes in the residuals of a fit."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import signal

import afm_scan_ros as afm
from afm_scan_ros.core.fit.axis import started
from afm_scan_ros.core.fit.descent import settle
from afm_scan_ros.core.fit.estimator import AxisFit
from afm_scan_ros.core.fit.modes import add_first_mode, first_mode, further_modes
from afm_scan_ros.core.fit.score_test import ScoreTest
from afm_scan_ros.core.types import Array
from helpers.fit_cases import (
    CREEP,
    DAMPING,
    FREQUENCY,
    GAIN,
    PERIOD,
    SETTINGS,
    displaced,
    levels,
    of_plays,
    of_plays_alone,
    record,
)


def waves() -> Array:
    """Two periods of a multisine about the resonance."""
    rng = np.random.default_rng(8)
    lines = np.arange(400, 900)
    spectrum = np.zeros(10_001, complex)
    spectrum[lines] = np.exp(2j * np.pi * rng.random(len(lines)))
    wave = np.tile(np.fft.irfft(spectrum, 20_000), 2)
    return np.concatenate([[0.0], wave / np.abs(wave).max(), [0.0]])


def test_waves_about_a_resonance_say_what_the_gain_is() -> None:
    """A straight line through them has another, as the phase turns."""
    drive = waves()
    moved = displaced(lambda volts: volts, drive)
    layout, given, _, theta = of_plays_alone(drive, moved)
    line = float(drive @ moved / (drive @ drive))
    fit = AxisFit(layout, given, line, theta)
    fit.weigh()
    found = first_mode(fit)
    assert found is not None
    assert abs(line / GAIN - 1.0) > 0.5
    assert line * found.gain == pytest.approx(GAIN * (1.0 + CREEP[0]), rel=0.15)
    assert found.mode[0] / (2.0 * np.pi) == pytest.approx(FREQUENCY, rel=0.02)


@pytest.mark.evidence
def test_a_mode_is_seen_beside_a_record_of_noise() -> None:
    """Noise has many lines, but none of the residuals about the resonance."""
    driven, slow = waves(), levels(3, 10, 40_000)
    layout, given, gain, theta = of_plays_alone(driven, displaced(lambda volts: volts, driven))
    noise = 1e-7 * np.random.default_rng(9).standard_normal(len(slow))
    moved = displaced(lambda volts: volts, slow) + noise
    given += of_plays_alone(slow, moved)[1]
    fit = AxisFit(layout, given, gain, theta)
    fit.weigh()
    found = first_mode(fit)
    assert found is not None
    assert found.mode[0] / (2.0 * np.pi) == pytest.approx(FREQUENCY, rel=0.02)


def test_a_mode_is_seen_beside_loops_that_are_not_fitted() -> None:
    """Of waves that ride on triangles a straight line leaves loops ten times as large."""
    seconds = PERIOD * np.arange(40_000)
    swept = signal.chirp(seconds, 60.0, seconds[-1], 900.0)
    triangle = 3.0 * signal.sawtooth(2.0 * np.pi * seconds + 0.5 * np.pi, 0.5)
    drive = np.minimum(seconds / 0.1, 1.0) * (triangle + 0.05 * swept)
    layout, given, _, theta = of_plays_alone(drive, record(of_plays, drive).displacement[:, 0])
    fit = AxisFit(layout, given, GAIN, theta)
    fit.weigh()
    found = next(iter(further_modes(fit)), None)
    assert found is not None
    assert found.mode[0] / (2.0 * np.pi) == pytest.approx(FREQUENCY, rel=0.02)
    assert found.mode[1] == pytest.approx(DAMPING, rel=0.6)


@given(seed=st.integers(0, 10_000))
@settings(max_examples=10)
def test_noise_has_no_mode(seed: int) -> None:
    rng = np.random.default_rng(seed)
    drive = levels(seed, 20, 400)
    moved = GAIN * drive + 1e-9 * rng.standard_normal(len(drive))
    fit = AxisFit(*of_plays_alone(drive, moved)[:2], GAIN, of_plays_alone(drive, moved)[3])
    fit.weigh()
    assert next(iter(further_modes(fit)), None) is None


def test_neither_plays_nor_lags_hide_a_mode() -> None:
    """They imitate what rings behind the corners of triangles, if they are fitted first."""
    cycles = np.interp(np.arange(12_000) % 1000, [0, 500, 1000], [0.0, 1.0, 0.0])
    drive = cycles * np.linspace(4.0, 1.0, len(cycles))
    fit = AxisFit(*of_plays_alone(drive, record(of_plays, drive).displacement[:, 0]))
    settle(fit, 8, (*fit.layout.operator.parts, "lags", "creep"))
    found = next(iter(further_modes(fit)), None)
    assert found is not None
    assert found.mode[0] / (2.0 * np.pi) == pytest.approx(FREQUENCY, rel=0.05)


@pytest.mark.evidence
def test_no_mode_explains_more_than_is_left_whatever_is_tried_beside_it() -> None:
    """What a mode explains beyond its imitation is a small difference of large products."""
    cycles = np.interp(np.arange(12_000) % 1000, [0, 500, 1000], [0.0, 1.0, 0.0])
    drive = cycles * np.linspace(4.0, 1.0, len(cycles))
    fit = AxisFit(*of_plays_alone(drive, record(of_plays, drive).displacement[:, 0]))
    settle(fit, 20, searching=True)
    free = fit.theta > fit.layout.lowest()
    test, left = ScoreTest(fit, free), fit.misfit(fit.theta)
    places = [(2.0 * np.pi * FREQUENCY * share, 0.06) for share in (0.8, 0.9, 1.0, 1.1, 1.2)]
    together = list(test.of(places))
    for place, beside in zip(places, together, strict=True):
        (alone,) = test.of([place])
        assert beside.chance == pytest.approx(alone.chance, rel=0.02, abs=0.1)
        assert alone.chance < 1.02 * left + fit.near


def test_a_broad_mode_that_hides_the_loops_is_found() -> None:
    """Its damping is near the greatest, at which a bend would be explained best."""
    drive, omega = waves(), 2.0 * np.pi * FREQUENCY
    system = signal.lti([omega**2], [1.0, 2.0 * 0.095 * omega, omega**2])
    _, moved, _ = signal.lsim(system, drive, PERIOD * np.arange(len(drive)), interp=False)
    noise = 1e-9 * np.random.default_rng(9).standard_normal(len(drive))
    fit = AxisFit(*of_plays_alone(drive, GAIN * moved + noise))
    fit.weigh()
    found = first_mode(fit)
    assert found is not None
    assert found.mode[0] / (2.0 * np.pi) == pytest.approx(FREQUENCY, rel=0.03)
    assert found.mode[1] == pytest.approx(0.095, rel=0.2)


def test_a_mode_is_found_under_the_loops_of_a_slow_drive() -> None:
    """Below its frequency far more is left in each line, and none of it is noise."""
    drive = levels(3, 40, 1500)
    fit = AxisFit(*of_plays_alone(drive, record(of_plays, drive).displacement[:, 0]))
    fit.weigh()
    found = next(iter(further_modes(fit)), None)
    assert found is not None
    assert found.mode[0] / (2.0 * np.pi) == pytest.approx(FREQUENCY, rel=0.03)


def test_what_a_delay_leaves_is_no_mode_above_all_that_moves() -> None:
    """It would bend the response of slower motion as the delay does, and ring nowhere."""
    seconds = PERIOD * np.arange(20_000)
    early, late = (
        signal.chirp(at, 20.0, seconds[-1], 400.0) * np.minimum(seconds / 0.1, 1.0)
        for at in (seconds, seconds - 0.4 * PERIOD)
    )
    noise = 1e-10 * np.random.default_rng(3).standard_normal(len(early))
    fit = AxisFit(*of_plays_alone(early, GAIN * late + noise))
    settle(fit, 4, ("lags",))
    assert next(iter(further_modes(fit)), None) is None


def test_a_bend_of_the_response_is_no_mode() -> None:
    """A lag is explained best by the greatest damping."""
    rng = np.random.default_rng(4)
    drive = levels(5, 30, 600)
    pole = np.exp(-PERIOD * 2.0 * np.pi * FREQUENCY)
    moved = GAIN * signal.lfilter([0.0, 1.0 - pole], [1.0, -pole], drive)
    moved += 1e-9 * rng.standard_normal(len(drive))
    fit = AxisFit(*of_plays_alone(drive, moved))
    fit.weigh()
    assert next(iter(further_modes(fit)), None) is None


@pytest.mark.parametrize(("peak", "seen"), [(0.03, 0), (0.5, 1)])
def test_a_mode_within_another_s_bandwidth_is_no_error_of_its_peak(peak: float, seen: int) -> None:
    """Hysteresis bends the peak of a resonance by some per cent, at its top."""
    drive = 0.1 * waves()
    moved = displaced(lambda volts: volts, drive)
    sharp, omega = 0.2 * DAMPING, 2.0 * np.pi * 1.01 * FREQUENCY
    system = [omega**2], [1.0, 2.0 * sharp * omega, omega**2]
    above, below, _ = signal.cont2discrete(system, PERIOD)
    weight = peak * sharp / DAMPING
    moved += GAIN * weight * signal.lfilter(above.ravel(), below, drive)
    moved += 1e-12 * np.random.default_rng(3).standard_normal(len(drive))
    fit = AxisFit(*of_plays_alone(drive, moved))
    fit.weigh()
    add_first_mode(fit)
    settle(fit, 20, ("lags", "modes", "creep"))
    assert len(further_modes(fit)) == seen


def test_loops_of_slow_triangles_are_no_mode() -> None:
    """Beside a straight line a mode as slow as they are explains a good part of them."""
    seconds = 2e-3 * np.arange(6000)
    triangles = signal.sawtooth(2.0 * np.pi * seconds + 0.5 * np.pi, 0.5)
    fading = 3.5 * (1.0 - seconds / seconds[-1]) * triangles
    given = [
        afm.Record(drive, 1e-6 * wide(drive), period)
        for drive, period in ((levels(1, 60, 400), 5e-4), (fading, 2e-3))
    ]
    fit = started(given, "x", SETTINGS)
    fit.weigh()
    assert first_mode(fit) is None


def wide(drive: Array) -> Array:
    """Output of forty plays, whose loops open by a quarter of the range."""
    thresholds, play = np.linspace(0.05, 3.4, 40), np.zeros(40)
    output = np.empty_like(drive)
    for k, u in enumerate(drive):
        play = np.clip(play, u - thresholds, u + thresholds)
        output[k] = u + 0.06 * play.sum()
    return output
