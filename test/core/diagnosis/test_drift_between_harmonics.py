"""Drift lies between the harmonics of a motion too, where no tone is to take its place."""

import numpy as np
import pytest
from attrs import evolve

from afm_scan_ros.core.diagnosis import search as selection
from afm_scan_ros.core.diagnosis.axis_diagnosis import FOUND
from afm_scan_ros.core.diagnosis.diagnosis import diagnose
from afm_scan_ros.core.record import Record
from afm_scan_ros.core.scan_spec import ScanSpec
from helpers.in_process import ALL, default_model, scan

SPEC = ScanSpec(line_rate=20.0, lines=16, samples_per_line=500, preparation_cycles=2)
NAMES = "drift", "periodic_disturbance"


def test_a_drift_is_no_tone(monkeypatch: pytest.MonkeyPatch) -> None:
    few = tuple(c for c in selection.CANDIDATES if c.effect.name in NAMES)
    monkeypatch.setattr(selection, "CANDIDATES", few)
    healthy = scan(SPEC, ALL)
    moved = healthy.measured
    time = moved.sample_period * np.arange(len(moved.x))
    drifting = evolve(moved, x=moved.x + 1e-6 * time)
    known = Record.of_traces("known", healthy.drive, moved, SPEC)
    record = Record.of_traces("scan", healthy.drive, drifting, SPEC)
    found = diagnose(default_model(), [record], healthy=[known])
    assert found.verdict == FOUND
    (effect,) = found.effects
    assert effect.name == "drift"
    posterior = found.by_axis["x"].selection.posterior
    assert posterior.of_effect("drift") > 0.99
    assert posterior.of_effect("periodic_disturbance") < 0.05
