"""Slow creep beyond the model's, and drifts that are not it."""

from functools import cache

import numpy as np
import pytest
from attrs import evolve

from afm_scan_ros.core.metrics import Scan
from afm_scan_ros.core.model import CreepModel, ScannerModel
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.scanner import predict
from afm_scan_ros.core.types import Array
from afm_scan_ros.features.online.adaptation import Adaptation, AxisState, Outcome
from afm_scan_ros.features.online.adapted_reference import AxisShift, with_shift
from helpers.in_process import ALL, default_model, scan

SPEC = ScanSpec(lines=40, line_rate=2.0, samples_per_line=2000, preparation_rate=5.0)
NOISE = 2e-9


@cache
def model() -> ScannerModel:
    """Model whose slowest section creeps within the scan."""
    creep = CreepModel((0.1, 0.2), (0.5, 5.0))
    return evolve(default_model(), y=evolve(default_model().axis("y"), creep=creep))


@cache
def done() -> Scan:
    """Scan from which the drive is taken."""
    return scan(SPEC, ALL, model=model())


def found(shift: AxisShift, drift: Array | float = 0.0) -> AxisState:
    """What is found of y on a scanner that is the model with a shift, with noise and a drift."""
    moved = predict(evolve(model(), y=with_shift(model().axis("y"), shift)), done().drive)
    noise = NOISE * np.random.default_rng(1).standard_normal(len(moved.y))
    adaptation = Adaptation(model(), SPEC)
    list(adaptation.add(done().drive, evolve(moved, y=moved.y + noise + drift)))
    return adaptation.states["y"]


@pytest.mark.parametrize("creep", [-0.2, 0.2])
def test_a_slow_creep_is_found(creep: float) -> None:
    assert found(AxisShift(creep=creep)).shift.creep == pytest.approx(creep, abs=0.01)


def test_without_it_nothing_is_changed() -> None:
    assert found(AxisShift()).shift.creep == 0.0


def test_a_drift_is_not_taken_for_creep() -> None:
    time = SPEC.sample_period * np.arange(len(done().drive.y))
    state = found(AxisShift(), 3e-6 * np.sin(2.0 * np.pi * time / 7.0))
    assert state.shift.creep == 0.0
    assert state.findings["creep"].outcome is Outcome.OTHER_CAUSE
