"""A stage read through a low-pass, as of a sensor, in records of unknown start."""

import numpy as np
import pytest
from scipy.signal import cont2discrete, lfilter, tf2ss

import afm_scan_ros as afm
from afm_scan_ros.core.fit.axis import fit_axis
from afm_scan_ros.core.fit.model_of_fit import model_of
from afm_scan_ros.core.model import ScannerModel
from afm_scan_ros.core.types import Array

PERIOD, FINER, HIGHEST = 1e-4, 10, 5.0
THRESHOLDS = 2.5 * np.linspace(0.02, 0.95, 60)  # V
WEIGHTS = 0.012 * np.exp(-THRESHOLDS / 1.2) * THRESHOLDS**0.3
CREEP = 0.035 / 6.0  # of each of six elements a decade
CORNER = 2.0 * np.pi * 512.0


def resonance(omega: float, damping: float, signal: Array) -> Array:
    system = tf2ss([omega**2], [1.0, 2.0 * damping * omega, omega**2])
    a, b, c, d, _ = cont2discrete(system, PERIOD / FINER)
    states, result = np.zeros(2), np.empty_like(signal)
    for k, value in enumerate(signal):
        result[k] = c[0] @ states + d[0, 0] * value
        states = a @ states + b[:, 0] * value
    return result


def moved(drive: Array, seed: int, *, low_pass: bool) -> Array:
    """Displacement (m) of a stage that has been used from end to end."""
    used = np.interp(np.arange(8000), [0, 2000, 4000], [0.0, HIGHEST, 0.0])
    plays, forces = np.zeros_like(THRESHOLDS), []
    for volts in np.concatenate([used, drive]):
        plays = np.minimum(volts + THRESHOLDS, np.maximum(volts - THRESHOLDS, plays))
        forces.append(volts + WEIGHTS @ plays)
    force = np.array(forces) + 0.004 * np.square(forces)
    rigid = resonance(2.0 * np.pi * 1800.0, 0.03, np.repeat(force, FINER))
    slow = rigid.copy()
    for constant in np.geomspace(3e-3, 300.0, 30):
        kept = np.exp(-PERIOD / FINER / constant)
        slow += CREEP * lfilter([0.0, 1.0 - kept], [1.0, -kept], rigid)
    read = resonance(CORNER, np.sqrt(0.5), slow) if low_pass else slow
    noise = 0.4e-9 * np.random.default_rng(seed).standard_normal(len(drive))
    return np.asarray(1e-6 * read[FINER * len(used) :: FINER] + noise)


def triangles(rate: float) -> Array:
    """Nine amplitudes, three triangles each (V), of a rate in Hz."""
    sizes = np.repeat(np.linspace(0.5, 0.1, 9), 3) * HIGHEST
    turns = np.column_stack([0.5 * HIGHEST + sizes, 0.5 * HIGHEST - sizes]).ravel()
    corners = np.concatenate([[0.0], turns, [0.0]])
    count = round(0.5 / rate / PERIOD)
    places = np.arange(count * (len(corners) - 1)) / count
    return np.asarray(np.interp(places, range(len(corners)), corners))


@pytest.mark.evidence
@pytest.mark.parametrize("low_pass", [True, False])
def test_triangles_of_two_rates_predict_a_third(*, low_pass: bool) -> None:
    records = [
        afm.Record(drive, moved(drive, seed, low_pass=low_pass), PERIOD, axes=("x",))
        for seed, drive in enumerate(map(triangles, (20.0, 40.0)))
    ]
    fit = fit_axis(records, "x")
    sensor = fit.layout.sensor_of(fit.theta)
    assert (sensor is not None) == low_pass
    if sensor is not None:
        assert sensor.order == 2
        assert sensor.corner == pytest.approx(512.0, rel=0.02)
    resonances = [omega / (2.0 * np.pi) for omega, *_ in fit.layout.of_modes(fit.theta)]
    assert resonances == pytest.approx([1800.0], rel=0.01)
    fresh = triangles(100.0)
    true = moved(fresh, 9, low_pass=low_pass)
    found = afm.Model(ScannerModel(x=model_of(fit)), "x").predict(fresh, PERIOD, beyond="extend")
    error = (found - true)[2000:]
    assert np.std(error) < 5e-4 * np.ptp(true)
    assert abs(np.polyfit(true[2000:], error, 1)[0]) < 1e-3
