"""A displacement read after its drive's updates, as a slow program does that writes, then reads."""

from pathlib import Path

import numpy as np
import pytest

import afm_scan_ros as afm
from afm_scan_ros.core.types import Array

PERIOD, NOISE = 0.02, 1e-9
THRESHOLDS = np.array([2.0, 6.0, 12.0, 20.0, 30.0, 40.0])
WEIGHTS = 1e-7 * np.array([0.3, 0.2, 0.2, 0.15, 0.1, 0.05])


def loops(*heights: float) -> Array:
    """Triangles of two seconds from 0 V up to so many volts, after half a second at rest."""
    triangle = 1.0 - np.abs(np.linspace(-1.0, 1.0, 100, endpoint=False))
    return np.concatenate([np.zeros(25), *(height * triangle for height in heights)])


def moved(drive: Array) -> Array:
    """Displacement (m) of six plays and a spring, which follow the drive within a sample."""
    state, course = np.zeros(6), np.empty(len(drive))
    for k, volts in enumerate(drive):
        state = np.clip(state, volts - THRESHOLDS, volts + THRESHOLDS)
        course[k] = WEIGHTS @ state + 5e-8 * volts
    return course


def recorded(drive: Array, *, after: bool, seed: int) -> afm.Record:
    """Read after each update, or just before it, where nothing of it shows yet."""
    course = moved(drive)
    seen = course if after else np.append(course[0], course[:-1])
    noise = NOISE * np.random.default_rng(seed).standard_normal(len(drive))
    return afm.Record(drive, seen + noise, PERIOD, name=f"loops {seed}")


@pytest.mark.parametrize("after", [pytest.param(True, marks=pytest.mark.evidence), False])
def test_slow_loops_are_predicted_as_they_were_read(tmp_path: Path, *, after: bool) -> None:
    drives = loops(100, 100, 80, 60, 40, 20, 50, 90), loops(100, 70, 30, 85, 55, 10, 100)
    model = afm.identify([recorded(one, after=after, seed=k) for k, one in enumerate(drives)])
    model.save(tmp_path / "model.yaml")
    model = afm.load_model(tmp_path / "model.yaml")
    fresh = recorded(loops(95, 45, 75, 15), after=after, seed=9)
    missed = model.predict(fresh.drive, PERIOD) - fresh.displacement
    assert np.std(missed) < 3.0 * NOISE
    longer = recorded(np.tile(loops(95, 45, 75, 15), 3), after=after, seed=7)
    assert afm.diagnose(model, [longer]).verdict == "model_sufficient"


def test_a_few_loops_of_unknown_start_are_not_balanced_by_a_lead() -> None:
    """Lags of negative weights and another hysteresis explained such a record alone."""
    drive = np.tile(loops(100)[25:], 4)
    model = afm.identify([recorded(drive, after=True, seed=1)])
    fresh = recorded(np.tile(loops(100)[25:], 8), after=True, seed=2)
    missed = model.predict(fresh.drive, PERIOD) - fresh.displacement
    assert np.std(missed[200:]) < 1e-3 * np.ptp(fresh.displacement)


@pytest.mark.parametrize(
    "digits", [6, *(pytest.param(n, marks=pytest.mark.evidence) for n in (9, 17))]
)
def test_a_record_without_noise_is_identified(digits: int) -> None:
    """As made by a formula, and written with so many digits."""
    time = 1e-3 * np.arange(500)
    drive = 4.0 * np.sin(2.0 * np.pi * 5.0 * time) * np.minimum(1.0, 10.0 * time)
    seen = np.array([float(f"{value:.{digits}g}") for value in 8e-6 * drive])
    model = afm.identify([afm.Record(drive, seen, 1e-3)])
    assert np.std(model.predict(drive, 1e-3).ravel() - seen) < 1e-3 * np.ptp(seen)
