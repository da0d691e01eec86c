"""Proposed records keep the converter's limits, and what records show is not proposed again."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.drives.proposal import (
    ConverterLimits,
    Coverage,
    coverage,
    propose,
)
from afm_scan_ros.core.identification.records.kinds import recognised
from afm_scan_ros.core.types import Array

FAST = ConverterLimits(-10.0, 10.0, 5e3)


def resonant(drive: Array, sample_period: float, resonance: float) -> Array:
    """Displacement (m) of a resonance (Hz) with a damping of 0.01, in its periodic state."""
    ratio = np.fft.rfftfreq(len(drive), sample_period) / resonance
    response = 1e-6 / (1.0 - ratio**2 + 0.02j * ratio)
    return np.fft.irfft(response * np.fft.rfft(drive), len(drive))


@settings(max_examples=5)
@given(
    st.floats(1.0, 200.0),
    st.sampled_from([-100.0, -1.0, -0.01, 0.0]),
    st.sampled_from([2e3, 5e3]),
    st.one_of(st.none(), st.floats(0.01, 0.04)),
)
def test_drives_keep_the_limits_and_rest_at_zero(
    limit: float, lower: float, rate: float, share: float | None
) -> None:
    converter = ConverterLimits(lower * limit, limit, rate)
    have = Coverage(resonance=None if share is None else share * rate)
    for record in propose(converter, 10.0, 1e-6, have):
        for wave in (record.plan.x, record.plan.y):
            drive = wave
            assert drive.min() >= converter.lower * (1.0 + 1e-9) - 1e-12 * limit
            assert drive.max() <= limit * (1.0 + 1e-9)
            assert abs(drive[0]) < 1e-9 * limit
            assert abs(drive[-1]) < 1e-9 * limit
        assert record.plan.sample_period >= (1.0 - 1e-12) / rate


@pytest.mark.parametrize("lower", [-10.0, 0.0])
def test_each_proposed_drive_is_recognised_and_not_proposed_again(lower: float) -> None:
    converter = ConverterLimits(lower, 10.0, 5e3)
    proposed = propose(converter, 10.0, 1e-6, Coverage(resonance=200.0))
    kinds = {"hysteresis": None, "error": None, "creep": "creep"}
    assert [record.identifies for record in proposed] == list(kinds)
    for record in proposed:
        drive = record.plan.x
        assert recognised(drive) == kinds[record.identifies]
        moved = resonant(drive, record.plan.sample_period, 200.0)
        seen = coverage(drive, moved, record.plan.sample_period)
        lacking = propose(converter, 10.0, 1e-6, seen)
        assert record.identifies not in {other.identifies for other in lacking}


def test_a_survey_finds_the_resonance_and_the_other_records_follow() -> None:
    converter = ConverterLimits(-1.0, 1.0, 5e3)
    record = propose(converter, 10.0, 1e-6, Coverage())[0]
    assert record.identifies == "resonance"
    drive = record.plan.x
    moved = resonant(drive, record.plan.sample_period, 170.0)
    found = coverage(drive, moved, record.plan.sample_period)
    assert found.resonance == pytest.approx(170.0, rel=0.04)
    identifies = [each.identifies for each in propose(converter, 10.0, 1e-6, found)]
    assert identifies == ["hysteresis", "error", "creep"]


def test_a_range_out_of_reach_is_refused_with_the_largest() -> None:
    have = Coverage(loops=20.0, gain=1e-6)
    with pytest.raises(InputError, match=r"needs 30 V.*at most 20 µm"):
        propose(ConverterLimits(-10.0, 10.0, 50e3), 10.0, 30e-6, have)


def test_loops_reach_only_as_far_as_scans_need() -> None:
    proposed = propose(
        ConverterLimits(-10.0, 10.0, 50e3), 10.0, 10e-6, Coverage(gain=1e-6, resonance=300.0)
    )
    (loops,) = (record for record in proposed if record.identifies == "hysteresis")
    assert np.ptp(loops.plan.x) == pytest.approx(14.0, rel=0.03)


def test_limits_without_zero_are_refused() -> None:
    with pytest.raises(InputError, match="does not start at 0 V"):
        ConverterLimits(1.0, 10.0, 50e3)


def test_a_hold_too_short_for_creep_is_refused() -> None:
    with pytest.raises(InputError, match="shows no creep"):
        propose(ConverterLimits(-1.0, 1.0, 5e3), 1.0, 1e-6, Coverage())


def test_a_sweep_shows_the_resonance_and_is_not_asked_for_again() -> None:
    time = np.arange(0.0, 4.0, 2e-4)
    drive = 5.0 + np.sin(2.0 * np.pi * (5.0 + 150.0 * time) * time) * np.sin(np.pi * time / 4.0)
    seen = coverage(drive, resonant(drive, 2e-4, 200.0), 2e-4)
    assert seen.resonance == pytest.approx(200.0, rel=0.05)
    assert "survey" not in {each.plan.name for each in propose(FAST, None, 1e-6, seen)}
