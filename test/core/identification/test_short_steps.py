"""Steps too short for creep: they show the ring-down, or they are a scan's slow axis."""

import numpy as np
import pytest
from scipy.signal import cont2discrete, lfilter

import afm_scan_ros as afm
from afm_scan_ros.core.types import Array

PERIOD, RESONANCE, DAMPING, GAIN = 5e-5, 620.0, 0.02, 1e-7


def measured(drive: Array) -> Array:
    """Displacement (m) of a linear resonance, from rest where the drive begins, with 1 nm noise."""
    omega = 2.0 * np.pi * RESONANCE
    above, below, _ = cont2discrete(
        ([omega**2], [1.0, 2.0 * DAMPING * omega, omega**2]), PERIOD, "zoh"
    )
    moved = GAIN * (drive[0] + lfilter(above.ravel(), below, drive - drive[0]))
    return moved + 1e-9 * np.random.default_rng(1).standard_normal(len(drive))


@pytest.mark.parametrize("levels", [[0.0, 5.0], [0.0, 5.0, -3.0, 0.0]])
def test_a_ring_down_shows_the_resonance(levels: list[float]) -> None:
    drive = np.repeat(levels, round(0.2 / PERIOD))
    model = afm.identify([afm.Record(drive, measured(drive), PERIOD, start="depolarised")])
    vibration = model.scanner.x.effects.vibration
    found = {each.name: each for each in vibration.intervals}["resonance"]
    assert 0.5 * (found.lower + found.upper) == pytest.approx(RESONANCE, rel=1e-3)
    assert found.upper - found.lower < 5e-3 * RESONANCE
    creep = model.scanner.x.effects.creep
    assert creep.hold_times is not None
    assert creep.hold_times[1] <= PERIOD * len(drive)  # it says nothing of what is slower
    assert creep.intervals[0].upper < 1e-3


@pytest.mark.evidence
def test_a_ring_down_and_loops_predict_other_loops() -> None:
    steps = np.repeat([0.0, 5.0, -3.0, 0.0], round(0.2 / PERIOD))
    sine = np.sin(2.0 * np.pi * 5.0 * PERIOD * np.arange(round(0.8 / PERIOD)))
    records = [
        afm.Record(each, measured(each), PERIOD, start="depolarised")
        for each in (steps, 6.0 * sine)
    ]
    predicted = afm.identify(records).predict(4.0 * sine, PERIOD)
    residual = measured(4.0 * sine) - predicted.ravel()
    assert np.std(residual) < 1.2e-9  # of which the sensor's noise is 1 nm


@pytest.mark.evidence
def test_a_staircase_is_a_slow_axis() -> None:
    drive = np.repeat(np.linspace(0.0, 40.0, 33), 400)
    model = afm.identify([afm.Record(drive, measured(drive), PERIOD, start="depolarised")])
    predicted = model.predict(drive, PERIOD)
    residual = measured(drive) - predicted.ravel()
    assert np.std(residual) < 0.01 * np.std(predicted)
