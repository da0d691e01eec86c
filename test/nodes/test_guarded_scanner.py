"""A scanner in trouble comes to rest by itself, once, and then stays there."""

import time
from pathlib import Path

import numpy as np
import pytest

from afm_scan_ros.core.errors import ScanError
from afm_scan_ros.core.types import Trace
from afm_scan_ros.files.plant_file import load_plant
from afm_scan_ros.files.share import share_directory
from afm_scan_ros.nodes.guarded_scanner import GuardedScanner
from afm_scan_ros.simulation.scanner import Piezoscanner

PERIOD = 1e-4
PATIENCE = 30.0


def scanner() -> Piezoscanner:
    return Piezoscanner(load_plant(Path(share_directory() / "config/plant.yaml")), PERIOD, seed=1)


def test_trouble_ramps_the_drive_down_without_being_asked() -> None:
    trouble: list[str] = []
    inner = scanner()
    guarded = GuardedScanner(lambda: trouble[0] if trouble else None)
    guarded.begin(inner)
    rise = Trace(0, PERIOD, np.linspace(0.0, 2.0, 1000), np.linspace(0.0, -1.0, 1000))
    guarded.advance(rise)
    trouble.append("the source has been silent for 0.5 s")
    deadline = time.monotonic() + PATIENCE
    while guarded.outcome is None and time.monotonic() < deadline:
        time.sleep(0.01)
    guarded.close()
    assert guarded.outcome is not None
    assert guarded.outcome.startswith("the source has been silent for 0.5 s; drive ramped down")
    assert inner.next_sample > 1000
    resting = inner.ramp_down()
    assert np.all(resting.x == 0.0)
    assert np.all(resting.y == 0.0)
    with pytest.raises(ScanError, match="drive ramped down to 0 V"):
        guarded.advance(Trace(inner.next_sample, PERIOD, np.zeros(5), np.zeros(5)))


def test_it_is_ramped_down_once() -> None:
    inner = scanner()
    guarded = GuardedScanner(lambda: None)
    guarded.begin(inner)
    guarded.advance(Trace(0, PERIOD, np.linspace(0.0, 1.0, 500), np.zeros(500)))
    first = guarded.ramp_down("interrupted")
    after = inner.next_sample
    assert guarded.ramp_down("again") == first
    assert inner.next_sample == after
    guarded.close()
