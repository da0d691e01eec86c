"""A scanner whose drive stays away from 0 V is diagnosed: it rests at the nearest that it had."""

import numpy as np
import pytest

import afm_scan_ros as afm

PERIOD, COUNT, NOISE = 0.005, 1500, 5e-9


def recorded(seed: int, tone: float = 0.0) -> afm.Record:
    """Seven seconds at 1 Hz, from 0.5 V to 3.5 V, with a ``tone`` (m) of 7.3 Hz."""
    rng, seconds = np.random.default_rng(seed), PERIOD * np.arange(COUNT)
    growing = np.linspace(0.3, 1.0, COUNT)
    drive = 0.5 + 1.5 * (1.0 - np.cos(2.0 * np.pi * seconds)) * growing
    seen = 1e-5 * drive + tone * np.sin(2.0 * np.pi * 7.3 * seconds)
    return afm.Record(drive, seen + NOISE * rng.standard_normal(COUNT), PERIOD, name=f"scan {seed}")


@pytest.mark.evidence
def test_a_tone_is_found_and_a_healthy_record_is_none() -> None:
    model = afm.identify([recorded(seed) for seed in (1, 2)], linear=True)
    assert afm.diagnose(model, [recorded(3)]).verdict == "model_sufficient"
    found = afm.diagnose(model, [recorded(4, tone=30.0 * NOISE)])
    assert [effect.name for effect in found.effects] == ["periodic_disturbance"]
