"""Sweeps, noise and steps show the response of a known filter by local fits."""

import numpy as np
import pytest
from scipy import signal

import afm_scan_ros as afm
from afm_scan_ros.core.identification.drives.excitation import frequency_plan
from afm_scan_ros.core.identification.drives.waveforms import chirp, stepped_sine
from afm_scan_ros.core.identification.local_response import FrequencyResponse, local_response
from afm_scan_ros.core.identification.records.kinds import is_sweep
from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.axis import PlayBank

PERIOD = 1e-4
RESONANCE, DAMPING = 300.0, 0.02
CHIRP = chirp(PERIOD, 2.0, 800.0, seconds=8.0, amplitude=1.0, corner=200.0, fade=0.5)
STEPS = np.concatenate([np.arange(10.0, 240.0, 5.0), np.arange(240.0, 360.0, 3.0)])
STEPPED = stepped_sine(STEPS, PERIOD, dwell=0.25, amplitude=1.0, corner=200.0)
PLANS = {"chirp": CHIRP, "stepped": STEPPED}


def system() -> tuple[Array, Array]:
    omega = 2.0 * np.pi * RESONANCE
    continuous = [omega**2], [1.0, 2.0 * DAMPING * omega, omega**2]
    numerator, denominator, _ = signal.cont2discrete(continuous, PERIOD)
    return numerator[0], denominator


def true_response(found: FrequencyResponse) -> Array:
    """Complex response of the filter at the lines found."""
    return np.asarray(signal.freqz(*system(), 2.0 * np.pi * found.frequency * PERIOD)[1])


@pytest.mark.parametrize("plan", PLANS)
def test_response_is_that_of_the_filter(plan: str) -> None:
    drive = PLANS[plan]
    assert is_sweep(drive)
    found = local_response(drive, drive, signal.lfilter(*system(), drive), PERIOD)
    true = true_response(found)
    assert len(found.frequency) > 50
    error = np.abs(found.response / true - 1.0)
    assert np.median(error) < 1e-4
    assert error[found.frequency > 20.0].max() < 5e-3
    assert found.coherence[found.frequency > 20.0].min() > 0.999


def test_deviation_is_that_of_the_noise() -> None:
    drive = CHIRP
    clean = signal.lfilter(*system(), drive)
    noisy = clean + 0.01 * np.random.default_rng(1).standard_normal(len(drive))
    exact, found = (local_response(drive, drive, y, PERIOD) for y in (clean, noisy))
    error = np.abs(found.response - exact.response)
    assert np.sqrt(np.mean((error / found.deviation) ** 2)) == pytest.approx(1.0, abs=0.15)


def test_the_way_to_a_sweep_and_back_shows_no_line() -> None:
    """It is larger than the sweep, and so is its gain, as that of hysteresis."""
    time = PERIOD * np.arange(40_000)
    sweep = signal.chirp(time, 5.0, time[-1], 1000.0) * np.minimum(1.0, (time[-1] - time) / 0.1)
    ramp = np.linspace(0.0, 5.0, 5000)
    way = np.concatenate([np.zeros(2000), ramp, np.full(50_000, 5.0), ramp[::-1], np.zeros(2000)])
    drive, moved = way.copy(), 1.1 * way
    drive[14_000:54_000] += sweep
    moved[14_000:54_000] += sweep
    found = local_response(drive, drive, signal.lfilter(*system(), moved), PERIOD)
    true = true_response(found)
    assert np.abs(found.response / true - 1.0).max() < 0.01


def hysteretic(drive: Array) -> Array:
    """Rayleigh's law: plays of even density."""
    thresholds = np.linspace(0.0, 2.0, 200)
    bank = PlayBank(thresholds, np.full(200, 1.0 / 100.0), 1.0, 0.0, 0.0)
    return bank.apply(bank.relaxed(), drive)[1]


def test_sweep_cut_at_its_end_serves_too() -> None:
    drive = CHIRP[:-6000]
    found = local_response(drive, drive, signal.lfilter(*system(), drive), PERIOD)
    true = true_response(found)
    assert np.median(np.abs(found.response / true - 1.0)) < 1e-3


NOISE = np.random.default_rng(0).standard_normal(20_000)


@pytest.mark.parametrize("drive", [NOISE, np.repeat(NOISE[:200], 100)], ids=["noise", "steps"])
def test_any_drive_shows_the_response(drive: Array) -> None:
    noise = 1e-4 * np.random.default_rng(1).standard_normal(len(drive))
    moved = signal.lfilter([0.0, 0.3, -0.1], [1.0, -0.8, 0.2], drive) + noise
    found = local_response(drive, drive, moved, PERIOD)
    turn = 2.0 * np.pi * found.frequency * PERIOD
    error = np.abs(found.response - signal.freqz([0.0, 0.3, -0.1], [1.0, -0.8, 0.2], turn)[1])
    clear = found.coherence > 0.9
    assert np.count_nonzero(clear) > 10
    assert np.sqrt(np.mean((error / found.deviation)[clear] ** 2)) == pytest.approx(1.0, abs=0.3)


def test_a_record_too_short_for_a_line_shows_none() -> None:
    assert local_response(NOISE[:20], NOISE[:20], NOISE[:20], PERIOD).frequency.shape == (0,)


def test_multisines_and_noise_are_no_sweeps() -> None:
    assert not is_sweep(frequency_plan().x)
    assert not is_sweep(np.random.default_rng(0).standard_normal(10_000))


@pytest.mark.parametrize("plan", PLANS)
def test_drive_goes_from_rest_to_rest(plan: str) -> None:
    drive = PLANS[plan]
    rest = round(0.4 / PERIOD)
    assert np.abs(drive[:rest]).max() < 1e-9
    assert np.abs(drive[-rest:]).max() < 1e-9
    assert np.abs(drive).max() == pytest.approx(1.0, rel=1e-2)


@pytest.mark.evidence
def test_a_sweep_alone_of_a_scanner_with_hysteresis_gives_the_resonance() -> None:
    period, resonance = 2e-5, 820.0
    time = period * np.arange(100_000)
    drive = signal.chirp(time, 5.0, time[-1], 4000.0, "logarithmic", -90.0)
    omega = 2.0 * np.pi * resonance
    stage = signal.cont2discrete(([omega**2], [1.0, 2.0 * DAMPING * omega, omega**2]), period)
    moved = 4e-6 * signal.lfilter(stage[0][0], stage[1], hysteretic(drive))
    moved += 2e-9 * np.random.default_rng(0).standard_normal(len(drive))
    record = afm.Record(drive, moved, period, start="depolarised")
    axis = afm.identify([record]).scanner.x
    low, high = next((i.lower, i.upper) for i in axis.effects.vibration.intervals)
    assert low < resonance < high
    assert high - low < 0.01 * resonance
